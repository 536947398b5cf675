"""CutBench: cases against their formulas and limits, meshes, scores, bad input, the scenes, our own results. The environment has
SPHERECUT_SOURCE."""

import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as xml
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

SOURCE = Path(os.environ["SPHERECUT_SOURCE"])
FOLDER = SOURCE / "benchmarks" / "cutbench"
sys.path.insert(0, str(FOLDER))

import cutbench  # noqa: E402
import grid  # noqa: E402

ROUND = ["penny_tension", "penny_shear", "penny_torsion", "ellipse_tension"]


def run(script, *arguments, folder=FOLDER, path=None):
    environment = os.environ | ({"PATH": str(path)} if path is not None else {})
    return subprocess.run([sys.executable, folder / script, *map(str, arguments)], capture_output=True, text=True, env=environment)


def exact_result():
    """A result whose values are the exact ones."""
    cases = {name: {"values": {q["name"]: q["values"] for q in cutbench.read_case(name)["quantities"]}} for name in cutbench.case_names()}
    return {"code": "exact", "version": "1", "command": "none", "cases": cases}


def written(folder, result):
    file = folder / "result.json"
    file.write_text(json.dumps(result))
    return file


def quantity(case, name):
    return next(q for q in case["quantities"] if q["name"] == name)


def evaluated(case_name, name, point, **parameters):
    case = cutbench.read_case(case_name)
    case["parameters"].update(parameters)
    return cutbench.evaluate(quantity(case, name)["formula"], cutbench.names_of(case, point))


def surface(file):
    rows = [line.split() for line in file.read_text().splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], float)
    triangles = np.array([row[1:] for row in rows if row[0] == "f"], int) - 1
    return vertices, triangles


def test_values_points_and_surfaces_follow_from_the_formulas(tmp_path):
    copy = tmp_path / "cutbench"
    shutil.copytree(FOLDER, copy)
    for file in [*copy.glob("cases/*/*.obj")]:
        file.unlink()
    assert run("derive.py", folder=copy).returncode == 0
    for file in FOLDER.glob("cases/*/*"):
        assert (copy / file.relative_to(FOLDER)).read_bytes() == file.read_bytes(), file.name
    assert len(cutbench.case_names()) >= 8


def test_formulas_have_the_limits_that_are_known():
    penny, ellipse = cutbench.read_case("penny_tension"), cutbench.read_case("ellipse_tension")
    round_one = {"a": 0.01, "b": 0.01, "E_k": np.pi / 2}
    k = quantity(penny, "k_1")["values"][0]
    assert k == pytest.approx(2 * 100 * np.sqrt(0.01 / np.pi), rel=1e-9)
    assert evaluated("ellipse_tension", "k_1", [0.006, 0.008, 0], **round_one) == pytest.approx(k, rel=1e-9)
    assert evaluated("ellipse_tension", "opening", [0, 0, 0], **round_one) == pytest.approx(quantity(penny, "opening")["values"][0], rel=1e-9)
    at_ends = [evaluated("ellipse_tension", "k_1", point) for point in ([0, 0.0048, 0], [0.02, 0, 0])]
    assert at_ends[0] / at_ends[1] == pytest.approx(1 / np.sqrt(0.24), rel=1e-9)
    k2 = 1 - 0.24**2
    angles = (np.arange(20000) + 0.5) / 20000 * np.pi / 2
    assert ellipse["parameters"]["E_k"] == pytest.approx(np.sqrt(1 - k2 * np.sin(angles) ** 2).mean() * np.pi / 2, rel=1e-9)
    # Far from its neighbours and from the other side a cut is alone.
    assert evaluated("straight_crack", "k_1", [0, 0, 0], a=1e-4) == pytest.approx(100 * np.sqrt(np.pi * 1e-4), rel=1e-4)
    assert evaluated("straight_crack", "opening", [0, 0, 0], a=1e-4) == pytest.approx(4 * 0.91 * 100 * 1e-4 / 1e4, rel=1e-4)
    assert evaluated("edge_crack", "k_1", [0, 0, 0], b=1e-6) == pytest.approx(1.122 * 100 * np.sqrt(np.pi * 1e-6), rel=1e-3)
    # The opening just behind the front is that of its K.
    for case, name, jump, point, way in [
        ("penny_tension", "k_1", "opening", [0.01, 0, 0], [-1, 0, 0]),
        ("straight_crack", "k_1", "opening", [0.01, 0, 0], [-1, 0, 0]),
        ("ellipse_tension", "k_1", "opening", [0, 0.0048, 0], [0, -1, 0]),
        ("penny_shear", "k_2", "sliding", [0.01, 0, 0], [-1, 0, 0]),
    ]:
        r = 1e-9
        opening = evaluated(case, jump, np.array(point) + r * np.array(way))
        assert opening * 1e4 / (8 * 0.91) * np.sqrt(2 * np.pi / r) == pytest.approx(evaluated(case, name, point), rel=1e-4), case
    turn = evaluated("penny_torsion", "sliding", [0.01 - 1e-9, 0, 0])
    assert turn * 1e4 / (8 * 1.3) * np.sqrt(2 * np.pi / 1e-9) == pytest.approx(evaluated("penny_torsion", "k_3", [0.01, 0, 0]), rel=1e-4)


def test_far_displacements_of_the_tools_hold_the_force_in_balance():
    """The traction of the far field over a hemisphere adds up to the force, by finite differences of the formulas."""
    for name in ("punch", "hertz"):
        case = cutbench.read_case(name)
        formulas, names = case["supports"][0]["displacement"], cutbench.names_of(case)
        mu, lam = names["mu"], names["E"] * names["nu"] / ((1 + names["nu"]) * (1 - 2 * names["nu"]))
        force, radius, count, h = 0.0, 0.03, 24, 1e-6
        for i in range(count):
            angle = np.pi / 2 * (i + 0.5) / count
            n = np.array([np.sin(angle), 0, -np.cos(angle)])
            gradient = np.stack([(np.array(cutbench.vector(formulas, case, radius * n + h * e)) - cutbench.vector(formulas, case, radius * n - h * e)) / (2 * h)
                                 for e in np.eye(3)], axis=1)
            stress = lam * np.trace(gradient) * np.eye(3) + mu * (gradient + gradient.T)
            force += (stress @ n)[2] * 2 * np.pi * radius**2 * np.sin(angle) * np.pi / 2 / count
        assert force == pytest.approx(names["F"], rel=2e-3)
        assert names["F"] == pytest.approx(quantity(case, "force")["values"][0], rel=1e-9)


@pytest.mark.parametrize("name", cutbench.case_names())
def test_surfaces_are_closed_bodies_and_cuts_with_their_plus_side_up(name):
    case = cutbench.read_case(name)
    vertices, triangles = surface(FOLDER / "cases" / name / "body.obj")
    edges = Counter(tuple(pair) for t in triangles for pair in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0])))
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    corner = vertices[triangles]
    volume = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6
    assert volume == pytest.approx(np.prod(np.subtract(case["body"]["upper"], case["body"]["lower"])), rel=1e-6)
    if "cut" not in case:
        return
    cut = case["cut"]
    vertices, triangles = surface(FOLDER / "cases" / name / "cut.obj")
    corner = vertices[triangles]
    areas = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (areas @ np.array(cut["normal"], float) > 0).all()
    half = cut.get("half_axes") or [cut.get("radius")] * 2
    cap = 2 / (1 + np.cos(np.radians(cut.get("half_angle_degrees", 0))))
    exact = np.prod(cut["lengths"]) if cut["shape"] == "rectangle" else np.pi * half[0] * half[1] * cap
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(exact, rel=3e-3)
    if cut["shape"] == "cap":
        middle = np.array([0, 0, -cut["radius"]])  # of a sphere whose cap of 45 degrees has that rim
        assert np.linalg.norm(vertices - middle, axis=1) == pytest.approx(np.sqrt(2) * cut["radius"], rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", [*ROUND, "straight_crack", "edge_crack", "slit_compression", "severed_bar"])
def test_grids_are_cut_where_the_cut_is_and_nowhere_else(name, order):
    case = cutbench.read_case(name)
    made = grid.make_grid(case, order)
    assert len(made.pairs) and np.ptp(made.nodes[made.pairs], axis=1).max() == 0
    # No other node stands twice at a place.
    assert len(np.unique(np.round(made.nodes, 10), axis=0)) == len(made.nodes) - len(made.pairs)
    one = lambda x, n: n  # noqa: E731
    normal = np.array(case["cut"]["normal"], float)
    upper, lower = (grid.nodal_forces(made, order, made.faces[side], one).sum(axis=0) for side in ("cut+", "cut-"))
    half = case["cut"].get("half_axes") or [case["cut"].get("radius")] * 2
    inside = np.minimum(np.subtract(case["body"]["upper"], case["body"]["lower"]), 1)
    lengths = iter(case["cut"].get("lengths", []))
    k = int(np.argmax(normal))
    clipped = [min(next(lengths, 0), inside[(k + 1) % 3]), min(next(lengths, 0), inside[(k + 2) % 3])]
    area = {"edge_crack": 0.016 * 0.01}.get(name) or (np.prod(clipped) if case["cut"]["shape"] == "rectangle" else np.pi * half[0] * half[1])
    assert lower == pytest.approx(area * normal, rel=0.04, abs=1e-12) and upper == pytest.approx(-lower, rel=1e-12, abs=1e-15)
    whole = [grid.nodal_forces(made, order, made.faces[side], one) for side in ("-x", "+x", "-y", "+y", "-z", "+z")]
    extent = np.subtract(case["body"]["upper"], case["body"]["lower"])
    assert whole[5].sum(axis=0) == pytest.approx([0, 0, extent[0] * extent[1]], rel=1e-9, abs=1e-12)
    assert sum(whole).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    for element in made.elements:
        corner = made.nodes[element[:8]]
        assert np.linalg.det(np.stack([corner[[1, 2, 5, 6]].sum(0) - corner[[0, 3, 4, 7]].sum(0), corner[[2, 3, 6, 7]].sum(0) - corner[[0, 1, 4, 5]].sum(0),
                                       corner[4:].sum(0) - corner[:4].sum(0)])) > 0


def test_what_a_grid_cannot_hold_is_refused(tmp_path):
    for name, what in [("lens_tension", "cut"), ("hertz", "tool")]:
        for script in ("to_calculix.py", "to_sofa.py"):
            done = run(script, "--out", tmp_path / "new", name)
            assert done.returncode == 2 and done.stderr.count("\n") == 1 and f"its {what} has no grid" in done.stderr
    assert not (tmp_path / "new").exists()


def test_an_exact_result_passes_and_a_wrong_value_fails(tmp_path):
    result = exact_result()
    done = run("score.py", written(tmp_path, result))
    assert done.returncode == 0 and "fails" not in done.stdout
    count = sum(len(cutbench.read_case(name)["quantities"]) for name in cutbench.case_names())
    assert f"{count} of {count} values" in done.stdout
    result["cases"]["penny_shear"]["values"]["k_2"][3] *= 1.2
    del result["cases"]["hertz"]
    done = run("score.py", written(tmp_path, result))
    assert done.returncode == 1 and f"{count - 2} of {count - 1} values" in done.stdout
    row = next(line for line in done.stdout.splitlines() if "penny_shear" in line and "k_2" in line)
    assert "20 % fails" in row
    assert next(line for line in done.stdout.splitlines() if line.startswith("hertz")).endswith("-")


def spoiled(change):
    result = exact_result()
    change(result)
    return json.dumps(result)


BAD = [
    ("not json", "no JSON"),
    ("[]", "a list; allowed: an object"),
    (spoiled(lambda r: r.pop("version")), "version: None"),
    (spoiled(lambda r: r["cases"].update(nothing={"values": {}})), "cases.nothing: there is no such case"),
    (spoiled(lambda r: r["cases"]["hertz"].pop("values")), "cases.hertz.values: missing"),
    (spoiled(lambda r: r["cases"]["hertz"]["values"].update(heat=[1])), "cases.hertz.values.heat: no quantity"),
    (spoiled(lambda r: r["cases"]["hertz"]["values"].update(force=[1, 2])), "a list of 1 finite numbers"),
    (spoiled(lambda r: r["cases"]["hertz"]["values"].update(force=[float("nan")])), "a list of 1 finite numbers"),
    (spoiled(lambda r: r["cases"]["hertz"]["values"].update(force=["1"])), "a list of 1 finite numbers"),
]


@pytest.mark.parametrize("text, said", BAD)
def test_a_result_that_cannot_be_used_is_refused_in_one_line(tmp_path, text, said):
    file = tmp_path / "bad.json"
    file.write_text(text)
    done = run("score.py", file)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
    assert said in done.stderr and str(file) in done.stderr


def test_other_input_that_cannot_be_used_is_refused_and_nothing_is_lost(tmp_path):
    kept = tmp_path / "kept.json"
    kept.write_text("mine")
    for script, arguments, said in [
        ("score.py", [tmp_path / "none.json"], "No such file"),
        ("derive.py", ["no_such_case"], "case 'no_such_case': there is none of that name"),
        ("run_spherecut.py", ["--out", kept, "no_such_case"], "case 'no_such_case'"),
        ("run_spherecut.py", ["--out", kept, "--seeds", 0], "--seeds 0: out of range; allowed: 1 to 100"),
        ("run_spherecut.py", ["--out", tmp_path / "no" / "folder.json", "--coarse", "--seeds", 1, "confined_compression"], "No such file"),
        ("to_calculix.py", ["--out", kept, "severed_bar"], "File exists"),
        ("to_calculix.py", ["--out", tmp_path, "--run"], "--run and --result FILE go together"),
        ("to_calculix.py", ["--out", tmp_path, "--refine", 9], "--refine 9: out of range; allowed: 1 to 8"),
        ("to_sofa.py", ["--out", kept, "severed_bar"], "File exists"),
    ]:
        done = run(script, *arguments)
        assert done.returncode == 2 and done.stderr.count("\n") == 1 and said in done.stderr, f"{script} {arguments}: {done.stderr}"
    assert kept.read_text() == "mine"
    assert sorted(tmp_path.iterdir()) == [kept]


@pytest.mark.parametrize("formula", ["q + 1", "__import__('os')", "a.real", "sqrt(a, key=1)", "'a'", "[a]"])
def test_formulas_hold_nothing_but_arithmetic(formula):
    with pytest.raises(cutbench.BadInput):
        cutbench.evaluate(formula, {"a": 1.0})


def test_calculix_that_is_not_there_or_fails_leaves_no_result(tmp_path):
    result = tmp_path / "result.json"
    arguments = ["--out", tmp_path / "out", "--run", "--result", result, "severed_bar"]
    done = run("to_calculix.py", *arguments, path=tmp_path)
    assert done.returncode == 77 and "ccx is not installed" in done.stderr and not (tmp_path / "out").exists()
    false_one = tmp_path / "bin" / "ccx"
    false_one.parent.mkdir()
    false_one.write_text("#!/bin/sh\necho This is Version 0\n[ \"$1\" = -v ] || { echo ' *ERROR: no memory'; exit 201; }\n")
    false_one.chmod(0o755)
    done = run("to_calculix.py", *arguments, path=false_one.parent)
    assert done.returncode == 3 and done.stderr.count("\n") == 1 and "severed_bar: ccx -i severed_bar ended with 201" in done.stderr
    assert "no memory" in done.stderr and not result.exists()


def test_scenes_of_sofa_are_cut_held_and_loaded(tmp_path):
    done = run("to_sofa.py", "--out", tmp_path, "severed_bar", "edge_crack", "straight_crack")
    assert done.returncode == 0, done.stderr
    pieces = {}
    for name in ("severed_bar", "edge_crack", "straight_crack"):
        body = xml.parse(tmp_path / f"{name}.scn").getroot().find("Node")
        assert body.get("name") == name
        positions = np.array(body.find("MeshTopology").get("position").split(), float).reshape(-1, 3)
        cells = np.array(body.find("MeshTopology").get("hexahedra").split(), int).reshape(-1, 8)
        assert sorted(set(cells.ravel())) == list(range(len(positions)))
        label = np.arange(len(positions))
        for _ in range(len(positions)):
            least = np.minimum.reduceat(label[cells.ravel()], np.arange(0, cells.size, 8))
            new = label.copy()
            np.minimum.at(new, cells.ravel(), np.repeat(least, 8))
            if (new == label).all():
                break
            label = new
        pieces[name] = len(set(label))
        force = body.find("ConstantForceField")
        if force is not None:
            forces = np.array(force.get("forces").split(), float).reshape(-1, 3)
            assert np.abs(forces).max() > 0 and forces.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
            # s over the end of the strip; p over the cut, but for what its front bears from both sides
            pull = forces[forces[:, 2] > 0, 2].sum()
            assert pull == pytest.approx(100 * {"edge_crack": 0.04, "straight_crack": 0.02}[name] * 0.01, rel=0.03)
    assert pieces == {"severed_bar": 2, "edge_crack": 1, "straight_crack": 1}
    state = xml.parse(tmp_path / "severed_bar.scn").getroot().find("Node/MechanicalObject")
    moved = np.array(state.get("position").split(), float) - np.array(state.get("rest_position").split(), float)
    assert moved.max() == pytest.approx(0.001) and moved.min() == 0


def test_the_package_computes_cases_within_their_tolerance(tmp_path):
    out = tmp_path / "ours.json"
    done = run("run_spherecut.py", "--coarse", "--seeds", 1, "--out", out, "severed_bar", "confined_compression", "straight_crack", "punch")
    assert done.returncode == 0, done.stderr
    done = run("score.py", out)
    assert done.returncode == 0 and "6 of 6 values" in done.stdout, done.stdout


def test_the_page_has_the_table_of_the_results_that_are_stored():
    done = run("score.py", "--markdown", *sorted((FOLDER / "results").glob("*.json"), reverse=True))
    table = done.stdout.rpartition("\n\n")[0]
    assert table and table in (SOURCE / "docs" / "cutbench.md").read_text()
