"""Studies: their points, their runs on two cores, the table, what is refused, what comes after a kill."""

import itertools
import json
import math
import os
import shutil
import signal
import subprocess
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
import spherecut as sc
from conftest import COMMAND, SOURCE
from spherecut.sweep import read_study
from spherecut.sweep.study import latin_hypercube, read_toml, toml_text
from spherecut.sweep.table import rows_of, write_parquet
from sweep_support import KILLED, STUDY, arguments, program_that, settings, sweep, table, write_study


needs_snakemake = pytest.mark.skipif(shutil.which("snakemake") is None,
                                     reason="snakemake is not installed (Debian package snakemake): NO STUDY IS RUN")


def head(text):
    return 'scenario = "small.toml"\n' + text


def points(tmp_path, text):
    return [run.values for run in read_study(write_study(tmp_path, head(text))).runs]


def test_grid_has_every_combination(tmp_path):
    found = points(tmp_path, STUDY.split("\n", 3)[3].split("[[figure]]")[0])
    wanted = itertools.product([0.0005, 0.001], [0.1, 0.2, 0.3, 0.4], [1, 2, 3])
    assert [tuple(point.values()) for point in found] == list(wanted)
    assert list(found[0]) == ["tool.approach.depth", "material.poisson_ratio", "nodes.random_seed"]
    logarithmic = points(tmp_path, '[grid]\nmaterial.young_modulus = { from = 1e3, to = 1e5, count = 3, scale = "log" }')
    assert [point["material.young_modulus"] for point in logarithmic] == [1e3, 1e4, 1e5]


def test_list_and_parts_of_vectors(tmp_path):
    study = read_study(write_study(tmp_path, head("""
[[list]]
method.name = "galerkin"
"organ.size[2]" = 0.02
[[list]]
method.name = "collocation"
"organ.size[2]" = 0.03
[grid]
tool.approach.target = [[0.0, 0.0, 0.02], [0.002, 0.0, 0.02]]
""")))
    assert [(r.scenario["method"]["name"], r.scenario["organ"]["size"], r.scenario["tool"]["approach"]["target"][0])
            for r in study.runs] == [("galerkin", [0.04, 0.04, 0.02], 0.0), ("galerkin", [0.04, 0.04, 0.02], 0.002),
                                     ("collocation", [0.04, 0.04, 0.03], 0.0), ("collocation", [0.04, 0.04, 0.03], 0.002)]
    for run in study.runs:
        assert tomllib.loads(toml_text(run.scenario)) == run.scenario


def test_toml_that_is_written_is_read():
    content = {"a b": 'x "y" \\ \n \x7f ü', "n": [1, 2.5, True, 1e-30], "t": {"u": {"v": -0.0}, "w": [{"k": []}, {"k": {}}]}}
    assert tomllib.loads(toml_text(content)) == content


HYPERCUBE = """
[latin_hypercube]
samples = 20
seed = 7
keys.material.young_modulus = { from = 1e3, to = 1e5, scale = "log" }
keys.material.poisson_ratio = { from = 0, to = 0.45 }
keys.nodes.random_seed = { from = 1, to = 1000 }
keys.method.name = ["galerkin", "collocation"]
"""


def test_latin_hypercube_is_stratified(tmp_path):
    for seed in range(5):
        cube = latin_hypercube(17, 4, seed)
        assert cube.min() >= 0 and cube.max() < 1
        assert all(sorted(np.floor(column * 17)) == list(range(17)) for column in cube.T)
    found = points(tmp_path, HYPERCUBE)
    assert len(found) == 20
    log = [math.floor(20 * math.log(p["material.young_modulus"] / 1e3) / math.log(100)) for p in found]
    ratio = [math.floor(20 * p["material.poisson_ratio"] / 0.45) for p in found]
    seeds = [math.floor(20 * (p["nodes.random_seed"] - 1) / 1000) for p in found]
    assert sorted(log) == sorted(ratio) == sorted(seeds) == list(range(20)) and log != ratio
    assert all(isinstance(p["nodes.random_seed"], int) for p in found)
    assert sorted(p["method.name"] for p in found) == ["collocation"] * 10 + ["galerkin"] * 10


def test_points_depend_on_the_seed_alone(tmp_path):
    one = points(tmp_path, HYPERCUBE)
    assert points(tmp_path, HYPERCUBE) == one
    assert points(tmp_path, HYPERCUBE.replace("seed = 7", "seed = 8")) != one


@pytest.mark.parametrize("text, words", [
    ("[grid]\nmaterial.poisson_ratio = [0.3, 0.6]", ["material.poisson_ratio = 0.6", "<= 0.499", "run 0002"]),
    ("[grid]\nmaterial.yong_modulus = [1.0]", ["grid.material.yong_modulus", "nearest: material.young_modulus"]),
    ("[grid]\nmaterial.poisson_ratio = 0.3", ["grid.material.poisson_ratio = 0.3", "array"]),
    ("[grid]\nmaterial.poisson_ratio = []", ["grid.material.poisson_ratio = []", "array"]),
    ('[grid]\nmaterial.poisson_ratio = ["0.3 "]', ["material.poisson_ratio", "must be a number"]),
    ('[grid]\n"fixed[1].lower[2]" = [0.1]', ["fixed[1].lower[2] = 0.1", "has 1 of these"]),
    ('[grid]\nmethod.name = { from = 1, to = 2, count = 2 }', ["grid.method.name", "string", "array of values"]),
    ("[grid]\nmaterial.poisson_ratio = { from = 0.4, to = 0.1, count = 2 }", ["grid.material.poisson_ratio.to = 0.1", "over from"]),
    ("[grid]\nmaterial.poisson_ratio = { from = 0.1, to = 0.4 }", ["grid.material.poisson_ratio", "needs count"]),
    ("[grid]\nnodes.random_seed = { from = 1, to = 900000 }", ["grid.nodes.random_seed", "at most 100000"]),
    ("[grid]\nnodes.random_seed = [1, 2, 1]", ["runs 0001 and 0003 are the same", "nodes.random_seed = 1"]),
    ("[grid]\nnodes.random_seed = [1]\n[[list]]\nnodes.random_seed = 1", ["nodes.random_seed", "varied twice"]),
    ("[latin_hypercube]\nsamples = 0\nkeys.nodes.random_seed = [1]", ["latin_hypercube.samples = 0", "1 <= value"]),
    ("[latin_hypercube]\nsamples = 2", ["latin_hypercube.keys", "missing"]),
    ("[grids]\nnodes.random_seed = [1]", ["grids", "no such key", "latin_hypercube"]),
    ("", ["nothing is varied"]),
    ('[grid]\nnodes.random_seed = [1]\n[[figure]]\nx = "nodes.count"\ny = "a"', ["figure[0].x", "nodes.count", "not varied"]),
    ('[grid]\nnodes.random_seed = [1]\n[[figure]]\nx = "nodes.random_seed"', ["figure[0].y", "missing"]),
    ('[grid]\nnodes.random_seed = [1]\n[[figure]]\nx = "nodes.random_seed"\ny = "a"\nname = "../a"', ["figure[0].name", "../a"]),
    ("[grid\n", ["study.toml", "line"]),
])
def test_what_is_refused(tmp_path, text, words):
    study = write_study(tmp_path, head(text))
    said = sweep(study, tmp_path / "out")
    assert said.returncode == 2 and said.stdout == ""
    assert len(said.stderr.splitlines()) == 1 and said.stderr.startswith(f"spherecut: error: {study}: ")
    assert all(word in said.stderr for word in words), words
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("text", "words"), [
    ("a = " + "[" * 100_000, "deeper than 32"),
    ("a = " + "{a=" * 100_000, "deeper than 32"),
    ("a." * 40_000 + "a = 1", "deeper than 32"),
    ("a." * 40 + "a = 1", "deeper than 32"),
    ("#\n" * 3_000_000, "larger than 4194304 bytes"),
])
def test_texts_without_bottom_or_end(tmp_path, text, words):
    study = write_study(tmp_path, text)
    with pytest.raises(sc.InputError, match=words) as refused:
        read_toml(study)
    assert str(study) in str(refused.value) and len(str(refused.value)) < 300


def test_pipes_and_devices_are_no_studies(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    for file in (tmp_path / "pipe.toml", Path("/dev/zero"), tmp_path):
        with pytest.raises(sc.InputError, match="no file, but a folder, a pipe or a device"):
            read_toml(file)


def test_refused_folders_and_programs(tmp_path):
    study = write_study(tmp_path, STUDY)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    said = sweep(study, tmp_path / "mine")
    assert said.returncode == 2 and "no folder of a study" in said.stderr
    said = sweep(study, tmp_path / "out", program=tmp_path / "nothing")
    assert said.returncode == 2 and "SPHERECUT_COMMAND" in said.stderr
    said = sweep(study, tmp_path / "out", PATH=str(tmp_path))
    assert said.returncode == 2 and "snakemake is not there" in said.stderr and not (tmp_path / "out").exists()
    assert sweep(tmp_path / "none.toml", tmp_path / "out").stderr == f"spherecut: error: {tmp_path}/none.toml: there is no such file\n"


def test_dry_run_lists_and_writes_nothing(tmp_path):
    said = subprocess.run([COMMAND, "sweep", write_study(tmp_path, STUDY), "--out", tmp_path / "out", "--dry-run"],
                          capture_output=True, text=True)
    lines = said.stdout.splitlines()
    assert said.returncode == 0 and len(lines) == 24 and not (tmp_path / "out").exists()
    assert lines[0].split()[:3] == ["0001", "to", "run"] and "material.poisson_ratio = 0.1" in lines[0]


def test_the_program_says_what_is_missing(tmp_path):
    help_text = subprocess.run([COMMAND, "--help"], capture_output=True, text=True).stdout
    assert "sweep" in help_text
    shutil.copy(COMMAND, tmp_path / "spherecut")  # no package beside it
    said = subprocess.run([tmp_path / "spherecut", "sweep", "a.toml"], capture_output=True, text=True, cwd=tmp_path,
                          env={"PATH": "/usr/bin", "PYTHONNOUSERSITE": "1"})
    if "STUDY" not in said.stderr and "--out" not in said.stderr:  # where the package is not installed besides
        assert said.returncode == 2 and "cannot load the Python package spherecut" in said.stderr


def leaves(value, path):
    if isinstance(value, dict):
        return [leaf for key, inner in value.items() for leaf in leaves(inner, f"{path}.{key}")]
    if isinstance(value, list):
        return [leaf for number, inner in enumerate(value) for leaf in leaves(inner, f"{path}[{number}]")]
    return [(path, value)]


@needs_snakemake
def test_24_runs_one_killed_and_resumed(tmp_path):
    study, out = write_study(tmp_path, STUDY), tmp_path / "out"
    said = sweep(study, out, "--cores", "2", program=program_that(tmp_path, "0007", KILLED))
    assert said.returncode == 1 and "0007" in said.stderr
    rows = table(out)
    assert [row["status"] for row in rows] == ["not run" if row["run"] == "0007" else "done" for row in rows]
    assert not (out / "runs" / "0007" / "record.json").exists() and (out / "runs" / "0007" / "running").exists()
    kept = {run: (out / "runs" / run / "record.json").stat().st_mtime_ns for run in ("0001", "0024")}

    said = sweep(study, out, "--cores", "2")
    assert said.returncode == 0 and "1 of them to do" in said.stdout
    assert kept == {run: (out / "runs" / run / "record.json").stat().st_mtime_ns for run in kept}
    rows = table(out)
    assert [row["run"] for row in rows] == [f"{n:04d}" for n in range(1, 25)] and {row["status"] for row in rows} == {"done"}
    for row, values in zip(rows, itertools.product([0.0005, 0.001], [0.1, 0.2, 0.3, 0.4], [1, 2, 3])):
        assert tuple(float(row[k]) for k in ("tool.approach.depth", "material.poisson_ratio", "nodes.random_seed")) == values
        summary = json.loads((out / "runs" / row["run"] / "result" / "summary.json").read_text())
        assert float(row["summary.inputs.poisson_ratio"]) == values[1] and int(row["summary.nodes.random_seed"]) == values[2]
        found = leaves(summary, "summary")
        assert len(found) > 60 and {k for k, v in row.items() if k.startswith("summary.") and v} == {k for k, v in found if v not in (None, "")}
        for name, value in found:
            if isinstance(value, bool):
                assert row[name] == ("true" if value else "false")
            elif isinstance(value, (int, float)):
                assert float(row[name]) == value
            else:
                assert row[name] == (value or "")
    by_hand = sc.run(out / "runs" / "0007" / "scenario.toml")
    assert max(np.linalg.norm([by_hand.forces[f"force_{a}_N"] for a in "xyz"], axis=0)) == float(rows[6]["summary.peak_force.newtons"])

    png = (out / "peak_force.newtons_over_material.poisson_ratio_by_tool.approach.depth.png").read_bytes()
    assert png[:8] == b"\x89PNG\r\n\x1a\n" and len(png) > 10_000
    assert "<svg" in (out / "nodes.svg").read_text()
    said = sweep(study, out, "--collect", "--figure", "solver.unknowns,nodes.random_seed", "--figure", "peak_forc.newtons,nodes.random_seed")
    assert said.returncode == 2 and "nearest: peak_force.newtons" in said.stderr
    assert (out / "solver.unknowns_over_nodes.random_seed.png").exists()

    # More points come behind; a study that has lost some is refused.
    more = write_study(tmp_path, STUDY.replace("[0.0005, 0.001]", "[0.0005, 0.00075, 0.001]").replace("to = 3", "to = 3"), "more.toml")
    said = sweep(more, out, "--cores", "2")
    assert said.returncode == 0 and "36 runs" in said.stdout and "12 of them to do" in said.stdout
    grown = table(out)
    assert [row["summary.peak_force.newtons"] for row in grown[:24]] == [row["summary.peak_force.newtons"] for row in rows]
    assert {row["tool.approach.depth"] for row in grown[24:]} == {"0.00075"}
    before = (out / "table.csv").read_bytes()
    said = sweep(study, out)
    assert said.returncode == 2 and "run 0025 is none of its points" in said.stderr and "tool.approach.depth is 0.00075" in said.stderr
    (tmp_path / "small.toml").write_text((tmp_path / "small.toml").read_text().replace("10000.0", "20000.0"))
    said = sweep(more, out)
    assert said.returncode == 2 and "material.young_modulus is 10000.0 there and 20000.0" in said.stderr
    assert (out / "table.csv").read_bytes() == before


@needs_snakemake
def test_failures_are_rows(tmp_path):
    study, out = write_study(tmp_path, head("""
[grid]
"fixed[0].upper[2]" = [0.001, -0.0005]
nodes.random_seed = [1, 2]
""")), tmp_path / "out"
    said = sweep(study, out, "--cores", "2")
    rows = table(out)
    assert said.returncode == 1 and [row["status"] for row in rows] == ["done", "done", "failed", "failed"]
    assert all("base" in row["reason"] and row["exit_status"] == "2" and row["fixed[0].upper[2]"] == "-0.0005" for row in rows[2:])
    assert all(row["reason"] in said.stdout for row in rows[2:])
    at = (out / "runs" / "0003" / "record.json").stat().st_mtime_ns
    assert "0 of them to do" in sweep(study, out).stdout and (out / "runs" / "0003" / "record.json").stat().st_mtime_ns == at
    assert "2 of them to do" in sweep(study, out, "--retry").stdout and (out / "runs" / "0003" / "record.json").stat().st_mtime_ns > at
    assert [row["status"] for row in table(out)] == ["done", "done", "failed", "failed"]


@needs_snakemake
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_ends_in_good_order_and_goes_on(tmp_path, number):
    study, out = write_study(tmp_path, head("[grid]\nnodes.random_seed = [1, 2, 3]")), tmp_path / "out"
    process = subprocess.Popen(arguments(study, out, "--cores", "1"), stdout=subprocess.PIPE, text=True,
                               env=settings(out, program_that(tmp_path, "0002", "exec sleep 600")))
    while not (tmp_path / "happened").exists():
        assert process.poll() is None
        time.sleep(0.05)
    said = sweep(study, out)
    assert said.returncode == 2 and "another sweep is at work" in said.stderr
    process.send_signal(number)
    text, _ = process.communicate(timeout=120)
    assert process.returncode == 130 and "the same command goes on" in text
    assert "not run" in {row["status"] for row in table(out)} and not (out / "runs" / "0002" / "record.json").exists()
    said = sweep(study, out, "--cores", "1")
    assert said.returncode == 0 and {row["status"] for row in table(out)} == {"done"}


def test_parquet_has_what_the_csv_has(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not there: NO PARQUET IS WRITTEN")
    folder = tmp_path / "runs" / "0001"
    (folder / "result").mkdir(parents=True)
    (folder / "record.json").write_text('{"status": "done", "seconds": 1.5}')
    (folder / "result" / "summary.json").write_text('{"a": 1, "b": [true, null], "c": {"d": "e"}}')
    rows = rows_of(tmp_path, [{"run": "0001", "values": {"x": 2.5}}, {"run": "0002", "values": {"x": 3}}])
    assert write_parquet(tmp_path / "table.parquet", rows)
    read = parquet.read_table(tmp_path / "table.parquet").to_pylist()
    assert read[0]["summary.a"] == 1 and read[0]["summary.b[0]"] is True and read[0]["summary.c.d"] == "e"
    assert [row["x"] for row in read] == [2.5, 3.0] and read[1]["status"] == "not run"


def test_the_example_is_a_study():
    study = read_study(SOURCE / "examples" / "studies" / "press_spacing.toml")
    assert len(study.runs) == 24 and len(study.figures) == 2


@needs_snakemake
def test_what_stands_behind_the_dashes_is_for_snakemake_alone(tmp_path):
    study = write_study(tmp_path, head("[grid]\nnodes.random_seed = [1]"))
    said = sweep(study, tmp_path / "st", "--cores", "1", "--", "--no-such-option")
    assert said.returncode != 0
    assert "--no-such-option" in (tmp_path / "st" / "snakemake.log").read_text()
    again = sweep(study, tmp_path / "st", "--cores", "1", "--", "--printshellcmds")
    assert again.returncode == 0, again.stderr
    stray = sweep(study, tmp_path / "other", "stray")
    assert stray.returncode == 2 and "unrecognized arguments: stray" in stray.stderr
