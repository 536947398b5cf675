"""A study on Slurm: munge, controller and one node, started on loopback by this test; 24 runs, one cancelled, resumed."""

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from sweep_support import STUDY, program_that, sweep, table, write_study

missing = [name for name in ("munged", "slurmctld", "slurmd", "sbatch", "snakemake")
           if shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin") is None]
pytestmark = [
    pytest.mark.skipif(bool(missing), reason=f"{', '.join(missing)} not installed (Debian packages slurm-wlm, munge, snakemake): "
                                             "STUDIES ON SLURM ARE NOT TESTED"),
    pytest.mark.skipif(os.geteuid() != 0, reason="Slurm's daemons need root: STUDIES ON SLURM ARE NOT TESTED"),
]

CONFIGURATION = """
ClusterName=loopback
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
SchedulerParameters=sched_interval=1
KillWait=5
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=1000 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES State=UP
"""


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


@pytest.fixture
def slurm(tmp_path):
    folder = Path(tempfile.mkdtemp(prefix="spherecut-slurm-"))
    folder.chmod(0o755)  # munge looks at the folders of its socket
    for name in ("state", "spool", "munge"):
        (folder / name).mkdir()
    (folder / "munge").chmod(0o700)
    (folder / "munge" / "key").write_bytes(os.urandom(1024))
    (folder / "munge" / "key").chmod(0o400)
    conf = folder / "slurm.conf"
    conf.write_text(CONFIGURATION.format(host=socket.gethostname().split(".")[0], ports=free_ports(2), folder=folder))
    environment = {"SLURM_CONF": str(conf), "PATH": os.environ["PATH"] + ":/usr/sbin", "USER": os.environ.get("USER", "root")}
    munge = folder / "munge"
    daemons = []
    try:
        for command in (["munged", "--force", "--foreground", f"--socket={folder}/munge.socket", f"--key-file={munge}/key",
                         f"--pid-file={munge}/pid", f"--seed-file={munge}/seed", f"--log-file={munge}/log"],
                        ["slurmctld", "-D", "-f", str(conf)], ["slurmd", "-D", "-f", str(conf)]):
            with (folder / f"{command[0]}.out").open("w") as said:
                daemons.append(subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT, env=os.environ | environment))
            while command[0] == "munged" and not (folder / "munge.socket").exists():
                assert daemons[0].poll() is None, (folder / "munged.out").read_text()
                time.sleep(0.1)
        for _ in range(300):
            state = subprocess.run(["sinfo", "-h", "-o", "%t"], capture_output=True, text=True, env=os.environ | environment)
            if state.stdout.strip() == "idle":
                break
            for daemon in daemons:
                assert daemon.poll() is None, [file.read_text() for file in folder.glob("*.out")]
            time.sleep(0.2)
        else:
            pytest.fail(f"the node does not come up: {state}")
        yield environment
    finally:
        for daemon in reversed(daemons):
            daemon.send_signal(signal.SIGTERM)
        for daemon in daemons:
            daemon.wait(60)
        # Without control groups the step of a cancelled job can outlive it.
        for process in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                if bytes(tmp_path) in process.read_bytes():
                    os.kill(int(process.parent.name), signal.SIGKILL)
            except OSError:
                pass  # it has ended meanwhile
        shutil.rmtree(folder, ignore_errors=True)


def test_24_runs_one_cancelled_and_resumed(tmp_path, slurm):
    study, out = write_study(tmp_path, STUDY), tmp_path / "out"
    options = ("--slurm", "--jobs", "4", "--memory", "100")
    cancelled = program_that(tmp_path, "0007", 'scancel "$SLURM_JOB_ID"; exec sleep 600')
    said = sweep(study, out, *options, program=cancelled, **slurm)
    log = (out / "snakemake.log").read_text()
    assert said.returncode == 1 and "0007" in said.stderr, log[-3000:]
    assert [row["status"] for row in table(out)] == ["not run" if n == 7 else "done" for n in range(1, 25)], log[-3000:]
    assert log.count("has been submitted with SLURM jobid") == 24
    said = sweep(study, out, *options, **slurm)
    assert said.returncode == 0 and "1 of them to do" in said.stdout
    rows = table(out)
    assert len(rows) == 24 and {row["status"] for row in rows} == {"done"} and all(float(row["summary.peak_force.newtons"]) > 0 for row in rows)
