"""What the tests of studies share: a study of 24 runs, a program that is killed in one of them, the table."""

import csv
import os
import subprocess
import sys

from conftest import COMMAND, SMALL

STUDY = """
title = "A press"
scenario = "small.toml"

[grid]
tool.approach.depth = [0.0005, 0.001]
material.poisson_ratio = { from = 0.1, to = 0.4, count = 4 }
nodes.random_seed = { from = 1, to = 3 }

[[figure]]
x = "material.poisson_ratio"
y = "peak_force.newtons"
by = "tool.approach.depth"

[[figure]]
x = "tool.approach.depth"
y = "nodes.total"
name = "nodes"
format = "svg"
"""


def write_study(folder, text=STUDY, name="study.toml"):
    small = SMALL.replace("fine_spacing = 0.003", "fine_spacing = 0.004").replace("step = 0.2", "step = 0.5").replace(
        "figures = false", "figures = false\nvtp_every = 0").replace('shape = "block"', 'shape = "block"\nedge = 0.004')
    (folder / "small.toml").write_text(small)
    (folder / name).write_text(text)
    return folder / name


def sweep(study, out, *more, program=COMMAND, **environment):
    """spherecut sweep with the Python of this test, as the program starts it."""
    said = subprocess.run(arguments(study, out, *more), capture_output=True, text=True, timeout=600,
                          env=settings(out, program) | environment)
    print(said.stdout, said.stderr, sep="")
    return said


def arguments(study, out, *more):
    return [sys.executable, "-m", "spherecut.sweep", str(study), "--out", str(out), *more]


def settings(out, program=COMMAND):
    return os.environ | {"SPHERECUT_COMMAND": str(program), "MPLCONFIGDIR": str(out.parent / "mpl")}


def table(out):
    with (out / "table.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def program_that(folder, run, does):
    """A program that runs spherecut, but the first time in one run does something else."""
    script = folder / "program.sh"
    script.write_text(f"""#!/bin/bash
if [ "$(basename "$PWD")" = {run} ] && [ ! -e "{folder}/happened" ]; then
  touch "{folder}/happened"
  {does}
fi
exec "{COMMAND}" "$@"
""")
    script.chmod(0o755)
    return script


# The program is killed in the middle of its run, and with it the shell that stands for it.
KILLED = f"""mkfifo pipe
  "{COMMAND}" "$@" > pipe 2>&1 &
  read -r line < pipe
  kill -9 $! $$"""
