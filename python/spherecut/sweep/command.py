"""The command line of a study."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path
from typing import NoReturn, Optional

from .._core import InputError
from . import figures, table, workflow
from .study import Figure, Run, Study, check_figure, read_study, shown

DONE, NOT_ALL_DONE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

FORMAT = """
The study file has a scenario and what is varied, products of up to three parts (docs/sweep.md):

  scenario = "block.toml"                       # relative to the study file
  [grid]                                        # every combination
  tool.approach.depth = [0.001, 0.002]
  nodes.random_seed = { from = 1, to = 4 }      # seeds 1, 2, 3, 4
  [[list]]                                      # point by point
  method.name = "galerkin"
  [latin_hypercube]
  samples = 24
  seed = 1
  keys.material.young_modulus = { from = 2e3, to = 2e4, scale = "log" }
  [[figure]]
  x = "tool.approach.depth"
  y = "peak_force.newtons"
  by = "nodes.random_seed"

Options behind -- are passed on to Snakemake: spherecut sweep STUDY.toml --out FOLDER -- OPTIONS

Exit status: 0 every run is done, 1 runs have failed or are missing, 2 unusable input, 130 interrupted.
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} ({self.prog} --help)")


def _count(lower: int, upper: int) -> "type[int]":
    def read(text: str) -> int:
        if not text.lstrip("-").isdigit() or not lower <= int(text) <= upper:
            raise argparse.ArgumentTypeError(f"'{text}'; allowed: an integer, {lower} <= value <= {upper}")
        return int(text)

    return read  # type: ignore[return-value]


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="spherecut sweep", description="Run a scenario over a grid, a list or a Latin hypercube of its keys; "
                     "the same command goes on with what is missing.", epilog=FORMAT,
                     formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    parser.add_argument("study", type=Path, metavar="STUDY.toml", help="study file")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder for runs, table and figures; a new one, or that of this study")
    parser.add_argument("--cores", type=_count(1, 4096), default=len(os.sched_getaffinity(0)), metavar="N", help="cores of this machine; default all")
    parser.add_argument("--threads", type=_count(1, 256), default=1, metavar="N", help="threads of a run; the results do not depend on it; default 1")
    parser.add_argument("--slurm", action="store_true", help="submit the runs to Slurm")
    parser.add_argument("--jobs", type=_count(1, 100_000), default=100, metavar="N", help="with --slurm: jobs at a time; default 100")
    parser.add_argument("--memory", type=_count(10, 10_000_000), default=2000, metavar="MB", help="with --slurm: memory of a run; default 2000")
    parser.add_argument("--retry", action="store_true", help="run what has failed once more")
    parser.add_argument("--dry-run", action="store_true", help="check everything and list the runs; write nothing")
    parser.add_argument("--collect", action="store_true", help="run nothing; table and figures of what is there")
    parser.add_argument("--figure", action="append", default=[], metavar="Y,X[,BY]", help="one more figure: a column over a key, for each value of another key")
    return parser


def _parsed(arguments: list[str]) -> argparse.Namespace:
    at = arguments.index("--") if "--" in arguments else len(arguments)
    return _parser().parse_args(arguments[:at], argparse.Namespace(snakemake=arguments[at + 1:]))


def _program() -> str:
    """The program that runs a scenario: the one that called, the one beside the package, or one on the PATH."""
    given = os.environ.get("SPHERECUT_COMMAND")
    package = Path(__file__).absolute().parents[2]
    places = [Path(given)] if given else [package.parent / "spherecut", package.parents[2] / "bin" / "spherecut"]
    for place in places:
        if os.path.isfile(place) and os.access(place, os.X_OK):
            return str(place.absolute())
    found = None if given else shutil.which("spherecut")
    if found is None:
        raise InputError("the program spherecut is not there" + (f": SPHERECUT_COMMAND = {given}" if given else "")
                         + "; allowed: on the PATH, or SPHERECUT_COMMAND with its place")
    return found


def _wanted_figures(study: Study, given: list[str]) -> list[Figure]:
    wanted = list(study.figures)
    for text in given:
        parts = [part.strip() for part in text.split(",")]
        if len(parts) not in (2, 3) or not all(parts):
            raise InputError(f"--figure {text}: allowed: COLUMN,KEY or COLUMN,KEY,KEY")
        figure = Figure(x=parts[1], y=parts[0], by=parts[2] if len(parts) == 3 else None)
        check_figure(f"--figure {text}", figure, study.keys)
        wanted.append(figure)
    return wanted


def _say(line: str) -> None:
    try:
        print(line, flush=True)
    except BrokenPipeError:  # nobody reads on; the study goes on
        sys.stdout = open(os.devnull, "w")


def _list(study: Study, out: Path) -> None:
    for number, run in workflow.plan(study, out):
        status = table.record_of(out / "runs" / number).get("status", "to run")
        _say(f"{number}  {status:6}  " + "  ".join(f"{key} = {shown(value)}" for key, value in run.values.items()))


def _sweep(options: argparse.Namespace) -> int:
    study = read_study(options.study)
    wanted = _wanted_figures(study, options.figure)
    out: Path = options.out
    if options.dry_run:
        _list(study, out)
        return DONE
    program = _program()
    if not options.collect and shutil.which("snakemake") is None:
        raise InputError("snakemake is not there; apt-get install --no-install-recommends snakemake")
    named = workflow.plan(study, out)
    lock = workflow.claim(out)
    try:
        named = workflow.plan(study, out)  # as it is now that nobody else is at work there
        status, interrupted = 0, False
        workflow.lay_out(study, named, out, program, options.threads)
        if options.retry:
            workflow.forget_failures(out, named)
        missing = [number for number, _ in named if not table.record_of(out / "runs" / number)]
        _say(f"{len(named)} runs of {study.scenario_file}, {len(missing)} of them to do, in {out}")
        if missing and not options.collect:
            if options.slurm:
                arguments = ["--slurm", "--jobs", str(options.jobs)]
                # Snakemake 7.21 takes a rate over one a second for one every 33 seconds, for all jobs together.
                if "--max-status-checks-per-second" not in options.snakemake:
                    arguments += ["--max-status-checks-per-second", "1"]
                if "--default-resources" not in options.snakemake:
                    arguments += ["--default-resources", f"mem_mb={options.memory}"]
            else:
                arguments = ["--cores", str(options.cores)]
            status, interrupted = workflow.run(out, lock, arguments + options.snakemake, len(missing), _say)
        return _collect(out, study, named, wanted, status, interrupted)
    finally:
        os.close(lock)


def _collect(out: Path, study: Study, named: list[tuple[str, Run]], wanted: list[Figure], status: int, interrupted: bool) -> int:
    rows = table.rows_of(out, [{"run": number, "values": run.values} for number, run in named])
    table.write_csv(out / "table.csv", rows)
    written = ["table.csv"]
    if table.write_parquet(out / "table.parquet", rows):
        written.append("table.parquet")
    failed = [row for row in rows if row["status"] == "failed"]
    missing = [row for row in rows if row["status"] == table.NOT_RUN]
    for row in failed[:10]:
        _say(f"run {row['run']} failed: {row['reason']}")
    if len(failed) > 10:
        _say(f"and {len(failed) - 10} more failed; table.csv has their reasons")
    refused = []
    for figure in wanted:
        try:
            written.append(figures.draw(out, rows, figure, study.title).name)
        except ImportError:
            refused.append("figures need matplotlib, which is not there (python3-matplotlib)")
            break
        except InputError as error:
            refused.append(str(error))
    _say(f"{len(rows) - len(failed) - len(missing)} runs done, {len(failed)} failed, {len(missing)} not run; {out}: {', '.join(written)}")
    if interrupted:
        _say("interrupted: the same command goes on")
        return INTERRUPTED
    if missing:
        shown_runs = ", ".join(row["run"] for row in missing[:10]) + (", ..." if len(missing) > 10 else "")
        if status != 0:
            _complain(f"runs {shown_runs} have no end of their own: killed, or not begun ({out}/snakemake.log); the same command goes on")
    for line in refused:
        _complain(line)
    if failed or missing:
        return NOT_ALL_DONE
    return BAD_INPUT if refused else DONE


def _complain(text: str) -> None:
    for line in text.split("\n"):
        print(f"spherecut: error: {line}", file=sys.stderr, flush=True)


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command line; returns the exit status."""
    try:
        return _sweep(_parsed(sys.argv[1:] if arguments is None else arguments))
    except InputError as error:
        _complain(str(error))
        return BAD_INPUT
    except OSError as error:
        _complain(f"{error.filename or 'files'}: {error.strerror or error}")
        return BAD_INPUT
    except KeyboardInterrupt:
        _say("interrupted before there was anything to keep")
        return INTERRUPTED
