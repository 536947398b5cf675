#!/usr/bin/env python3
"""How a study would scale: the time of a run and Snakemake's own are measured, the rest is projected.

python3 examples/studies/scaling.py STUDY.toml [--runs 1000] [--seconds T]

A run is timed by the processor time that its study took on one core. Snakemake is timed on studies of two sizes whose
runs do nothing: what it needs to begin, and what for every run. It hands runs out one after the other, so that N runs
of t seconds on c cores take begin + max(N (t + script) / c, N each) at least; script is the time of a run's own script.
"""

import argparse
import csv
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def sweep(study, out, cores, **environment):
    """Wall clock and the processor time of everything below, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.monotonic()
    subprocess.run([sys.executable, "-m", "spherecut.sweep", study, "--out", out, "--cores", str(cores)], check=True,
                   stdout=subprocess.DEVNULL, env=os.environ | environment)
    wall = time.monotonic() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def empty_study(folder, scenario, runs):
    file = folder / f"empty_{runs}.toml"
    file.write_text(f'scenario = "{scenario}"\n[grid]\nnodes.random_seed = {{ from = 1, to = {runs} }}\n')
    return file


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    parser.add_argument("--runs", type=int, default=1000, help="of the study that is projected")
    parser.add_argument("--seconds", type=float, help="processor time of a run that was measured elsewhere, s; left out: the study is run")
    options = parser.parse_args()
    scenario = Path(__file__).resolve().with_name("block.toml")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = options.seconds or time_of_runs(options.study, folder / "study")
        script = min(timed_script(folder, scenario) for _ in range(5))
        few, many = 50, 250
        times = {count: sweep(empty_study(folder, scenario, count), folder / f"empty_{count}", 2, SPHERECUT_COMMAND="/bin/true")
                 for count in (few, many)}
        each = (times[many][1] - times[few][1]) / (many - few) - script  # processor time that is not the runs' own script
        begin = times[few][1] - few * (each + script)
    print(f"a run: {run:.3f} s; its script: {script:.3f} s; Snakemake and the table: {begin:.2f} s and {each:.4f} s a run")
    print(f"projected for {options.runs} runs:\n\n| cores | time, s | times faster | of that possible |\n|---|---|---|---|")
    one = None
    for cores in (1, 2, 4, 8, 16, 32, 64):
        total = begin + max(options.runs * (run + script) / cores, options.runs * each)
        one = one or total
        print(f"| {cores} | {total:.0f} | {one / total:.1f} | {100 * one / total / cores:.0f} % |")


def time_of_runs(study, out):
    """Mean processor time of the runs of a study, s."""
    sweep(study, out, 1)
    with (out / "table.csv").open(newline="") as file:
        times = [float(row["cpu_seconds"]) for row in csv.DictReader(file)]
    return sum(times) / len(times)


def timed_script(folder, scenario):
    """Processor time of a run's script without its run."""
    place = folder / "one"
    place.mkdir(exist_ok=True)
    (place / "record.json").unlink(missing_ok=True)
    (place / "scenario.toml").write_text(scenario.read_text())
    import spherecut.sweep
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, Path(spherecut.sweep.__file__).resolve().with_name("one_run.py"), place, "1", "/bin/true"], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
