"""The folder of a study, and the workflow that Snakemake runs in it."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, Callable, Optional

from .._core import InputError, __version__
from .study import Run, Study, flat, shown, toml_text
from .table import record_of

SNAKEFILE = '''\
# A study of spherecut, one rule a run. `spherecut sweep` runs it; Snakemake does so by itself as well, in this folder:
#   snakemake --cores 4 --keep-going --rerun-triggers mtime --ignore-incomplete
import json
import os
import shlex
import sys

with open(os.path.join(workflow.basedir, "study.json")) as file:
    study = json.load(file)
runs = [run["run"] for run in study["runs"]]


localrules: all


rule all:
    input: [f"runs/{run}/record.json" for run in runs]


for run in runs:
    rule:
        name: f"run_{run}"
        input: ancient(f"runs/{run}/scenario.toml")
        output: f"runs/{run}/record.json"
        threads: study["threads"]
        params: command=shlex.join([study["python"], study["one_run"], f"runs/{run}", str(study["threads"]), study["program"]])
        shell: "{params.command}"
'''


def load(out: Path) -> Optional[dict[str, Any]]:
    """What an output folder says of its study; None where there is no such folder or it is empty."""
    file = out / "study.json"
    if not file.exists():
        if out.exists() and (not out.is_dir() or any(entry.name != ".lock" for entry in out.iterdir())):
            raise InputError(f"--out {out}: is no folder of a study and not empty; allowed: a new folder, or that of this study")
        return None
    try:
        study = json.loads(file.read_text(encoding="utf-8"))
        if {"runs", "program"} <= study.keys():
            return dict(study)
    except (OSError, ValueError, AttributeError):
        pass
    raise InputError(f"{file}: cannot be read as the list of a study's runs; nothing has been changed")


def _difference(there: dict[str, Any], study: Study) -> str:
    """By what a scenario that was run differs from the nearest one of the study."""
    old = dict(flat(there))
    best: list[str] = []
    for run in study.runs:
        new = dict(flat(run.scenario))
        found = [k for k in [*old, *(k for k in new if k not in old)] if old.get(k) != new.get(k)]
        if not best or len(found) < len(best):
            best, nearest = found, new
    if not best:
        return "a file that it names has changed"
    key = best[0]
    told = [f"{shown(side[key])}" if key in side else "left out" for side in (old, nearest)]
    return f"{key} is {told[0]} there and {told[1]} in the nearest point of the study"


def plan(study: Study, out: Path) -> list[tuple[str, Run]]:
    """Numbers of the study's runs: those that the folder has keep theirs, new points come behind them.

    Raises InputError where the folder has a run that is no point of the study.
    """
    before = load(out)
    numbers = {} if before is None else {run["identity"]: run["run"] for run in before["runs"]}
    wanted = {run.identity: run for run in study.runs}
    for identity, number in numbers.items():
        if identity not in wanted:
            try:
                there = tomllib.loads((out / "runs" / number / "scenario.toml").read_text(encoding="utf-8"))
                why = _difference(there, study)
            except (OSError, ValueError, RecursionError):
                why = "its scenario.toml is gone"
            raise InputError(f"{study.file}: --out {out} has another study: run {number} is none of its points ({why}); "
                             "allowed: the study as it was, with points added, or another folder. Nothing has been changed")
    last = max((int(number) for number in numbers.values()), default=0)
    named = []
    for run in study.runs:
        if run.identity not in numbers:
            last += 1
            numbers[run.identity] = f"{last:04d}"
        named.append((numbers[run.identity], run))
    return sorted(named, key=lambda item: int(item[0]))


def _write(file: Path, text: str) -> None:
    """As a whole, and only where it is another: Snakemake looks at the time of a file."""
    if file.exists() and file.read_text(encoding="utf-8") == text:
        return
    part = file.with_name(file.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(file)


def lay_out(study: Study, named: list[tuple[str, Run]], out: Path, program: str, threads: int) -> None:
    """Writes scenarios, study.json and the Snakefile."""
    for number, run in named:
        folder = out / "runs" / number
        folder.mkdir(parents=True, exist_ok=True)
        _write(folder / "scenario.toml", toml_text(run.scenario))
    content = {
        "spherecut": __version__, "title": study.title, "scenario": str(study.scenario_file), "keys": study.keys,
        "program": program, "python": sys.executable, "one_run": str(Path(__file__).resolve().with_name("one_run.py")),
        "threads": threads,
        "runs": [{"run": number, "identity": run.identity, "values": run.values} for number, run in named],
    }
    _write(out / "study.json", json.dumps(content, indent=1) + "\n")
    _write(out / "Snakefile", SNAKEFILE)


def claim(out: Path) -> int:
    """The lock of a study's folder, which Snakemake inherits: one at a time, also when the first one's parent was killed."""
    out.mkdir(parents=True, exist_ok=True)
    lock = os.open(out / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(lock, 32, 0).decode(errors="replace").strip()
        raise InputError(f"--out {out}: another sweep is at work there" + (f" (process group {holder})" if holder else "")
                         + "; wait for it or end it") from None
    return lock


def forget_failures(out: Path, named: list[tuple[str, Run]]) -> None:
    """Failed runs are run once more."""
    for number, _ in named:
        if record_of(out / "runs" / number).get("status") == "failed":
            (out / "runs" / number / "record.json").unlink()


def run(out: Path, lock: int, arguments: list[str], count: int, say: Callable[[str], None]) -> tuple[int, bool]:
    """Has Snakemake run what has no record yet: its exit status, and whether it was interrupted.

    What it says goes into snakemake.log. SIGINT, SIGTERM and SIGHUP end it in good order: the runs finish their step and
    are run anew next time.
    """
    snakemake = shutil.which("snakemake")
    if snakemake is None:
        raise InputError("snakemake is not there; apt-get install --no-install-recommends snakemake")
    # Its own locks outlive a killed process, the one of this folder does not. A record is there as a whole or not at all.
    command = [snakemake, "--nolock", "--keep-going", "--rerun-triggers", "mtime", "--ignore-incomplete", "--nocolor", *arguments]
    interrupted = False
    with (out / "snakemake.log").open("a", encoding="utf-8") as log:
        process = subprocess.Popen(command, cwd=out, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   text=True, errors="replace", start_new_session=True, pass_fds=[lock])
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"{process.pid}\n".encode(), 0)

        def end(*_: Any) -> None:
            nonlocal interrupted
            if not interrupted:
                say("interrupted: the runs that are at work end now")
            interrupted = True
            try:
                os.killpg(process.pid, signal.SIGINT)
            except ProcessLookupError:
                pass

        before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
        try:
            assert process.stdout is not None
            told = 0
            for line in process.stdout:
                log.write(line)
                log.flush()
                if found := re.match(r"(\d+) of (\d+) steps", line):
                    ended = min(int(found[1]), count)
                    if ended == count or 10 * ended // count > 10 * told // count:
                        if ended != told:
                            say(f"{ended} of {count} runs")
                        told = ended
            status = process.wait()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
    return status, interrupted
