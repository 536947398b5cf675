"""One run of a study, as a rule of its workflow calls it: one_run.py FOLDER THREADS PROGRAM.

FOLDER has scenario.toml. Results come into FOLDER/result, what the program says into log.txt, how it ended into
record.json, which is there once the run has an end of its own: done, or failed with its reason. A run that was killed or
interrupted leaves no record, and this ends with status 1. It needs the standard library alone.
"""

from __future__ import annotations

import fcntl
import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

INTERRUPTED = 130


def reason_of(log: Path) -> str:
    """The last error that a program has told, without its name; else its last line."""
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip()]
    for line in reversed(lines):
        if "error:" in line:
            return line.split("error:", 1)[1].strip()
    return lines[-1] if lines else "it said nothing"


def write(file: Path, record: dict[str, object]) -> None:
    """All of it or nothing."""
    part = file.with_suffix(".part")
    part.write_text(json.dumps(record, indent=2) + "\n")
    part.replace(file)


def main(folder: Path, threads: str, program: str) -> int:
    folder = folder.resolve()
    record, running, result, log = (folder / name for name in ("record.json", "running", "result", "log.txt"))
    # The lock goes on to the program: whoever is left of an earlier try of this run is waited for.
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    os.set_inheritable(lock, True)
    fcntl.flock(lock, fcntl.LOCK_EX)
    if record.exists():
        return 0
    for old in (running, result):
        if old.exists():
            shutil.rmtree(old)
    begin = time.monotonic()
    with log.open("w") as said:
        try:
            process = subprocess.Popen([program, "run", "scenario.toml", "--out", "running", "--threads", threads], cwd=folder,
                                       stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT, pass_fds=[lock])
        except OSError as error:
            print(f"spherecut: error: {program}: {error.strerror}", file=sys.stderr)
            return 1
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: process.terminate())
        status = process.wait()
    if status < 0 or status == INTERRUPTED:
        how = "interrupted" if status == INTERRUPTED else f"killed by {signal.Signals(-status).name}"
        print(f"spherecut: run {folder.name} was {how}", file=sys.stderr)
        return 1
    if running.exists():
        running.rename(result)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    write(record, {
        "run": folder.name,
        "status": "done" if status == 0 else "failed",
        "reason": "" if status == 0 else reason_of(log),
        "exit_status": status,
        "seconds": round(time.monotonic() - begin, 4),
        "cpu_seconds": round(used.ru_utime + used.ru_stime, 4),
        "host": socket.gethostname(),
    })
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2], sys.argv[3]))
