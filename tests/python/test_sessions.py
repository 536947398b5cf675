"""Sessions from Python against the command line: same bits, same files, same words."""

import csv
import pickle
import re
import subprocess

import numpy as np
import pytest
import spherecut as sc

TIMES = {"seconds", "topology_s", "level_sets_s", "visibility_s", "sprinkling_s", "assembly_s", "solve_s", "intensities_s"}
COARSE = {"residual", "penetration_m", "rotation_deg", "force_jump", "imbalance_J"}  # printed with three digits


@pytest.fixture(scope="module", params=["block_slice.toml", "peel.toml"])
def runs(request, tmp_path_factory):
    """The same scenario by the command and from Python."""
    import conftest

    folder = tmp_path_factory.mktemp("runs")
    scenario = conftest.SOURCE / "scenarios" / request.param
    subprocess.run([conftest.COMMAND, "run", scenario, "--out", folder / "command", "--threads", "1"], check=True,
                   capture_output=True)
    frames = []
    run = sc.run(scenario, folder / "python", progress=False,
                 after_step=lambda session, result: frames.append(session.surface()))
    return folder, run, frames


def rows_of(file):
    with open(file, newline="") as text:
        return list(csv.DictReader(text))


def test_tables_are_those_of_the_command(runs):
    folder, run, _ = runs
    tables = {"forces.csv": run.forces, "cuts.csv": run.cuts, "tears.csv": run.tears}
    found = [name for name in tables if (folder / "command" / name).exists()]
    assert "cuts.csv" in found
    for name in found:
        theirs, ours = rows_of(folder / "command" / name), rows_of(folder / "python" / name)
        assert len(theirs) == len(ours) > 5
        for a, b in zip(theirs, ours):
            assert {k: v for k, v in a.items() if k not in TIMES} == {k: v for k, v in b.items() if k not in TIMES}
        assert list(tables[name]) == list(theirs[0])  # columns in their order
        for column, values in tables[name].items():
            if column in TIMES:
                continue
            for row, value in zip(theirs, values):
                if isinstance(value, np.ndarray):
                    assert [float(v) for v in row[column].split(";")] == pytest.approx(list(value), rel=1e-11)
                elif isinstance(value, str):
                    assert row[column] == value
                else:
                    assert float(row[column]) == pytest.approx(float(value), rel=1e-2 if column in COARSE else 1e-8)


def test_frames_are_those_of_the_command_bit_by_bit(runs):
    folder, _, frames = runs
    names = sorted(p.name for p in (folder / "command" / "frames").iterdir())
    assert names == sorted(p.name for p in (folder / "python" / "frames").iterdir())
    for name in names:
        assert (folder / "command" / "frames" / name).read_bytes() == (folder / "python" / "frames" / name).read_bytes()
    last = max(n for n in names if n.startswith("surface_"))
    data = (folder / "command" / "frames" / last).read_bytes()
    blocks = data[data.index(b'encoding="raw">\n_') + 17 :]
    count = int(re.search(rb'NumberOfPoints="(\d+)"', data)[1])
    points = np.frombuffer(blocks, dtype="<f8", count=3 * count, offset=offset_of(data, b"<Points>") + 8).reshape(-1, 3)
    assert np.array_equal(points, frames[-1]["points"])


def offset_of(data, after):
    return int(re.search(rb'offset="(\d+)"', data[data.index(after) :])[1])


def test_forces_of_a_press_bit_by_bit(tmp_path, small, command):
    scenario = small
    subprocess.run([command, "run", scenario, "--out", tmp_path / "run", "--threads", "1"], check=True, capture_output=True)
    run = sc.run(scenario)
    for row, force in zip(rows_of(tmp_path / "run" / "forces.csv"), run.forces["force_z_N"]):
        assert row["force_z_N"] == f"{force:.9g}"
    again = sc.run(sc.Scenario.from_text(scenario.read_text()))
    assert np.array_equal(run.forces["force_z_N"], again.forces["force_z_N"])
    assert run.forces["force_z_N"].max() > 0.05


@pytest.mark.parametrize(
    "old, new",
    [
        ("young_modulus = 10000.0", "young_modulus = -1.0"),
        ("poisson_ratio = 0.3", 'poisson_ratio = "much"\nhardness = 3'),
        ('shape = "block"', 'shape = "sponge"'),
        ("lower = [-0.06, -0.06, -0.001]\nupper = [0.06, 0.06, 0.001]", "lower = [1.0, 1.0, 1.0]\nupper = [2.0, 2.0, 2.0]"),
        ("fine_spacing = 0.003", "fine_spacing = 0.2"),
    ],
)
def test_words_are_those_of_the_command(tmp_path, small, command, old, new):
    text = small.read_text()
    assert old in text
    file = tmp_path / "bad.toml"
    file.write_text(text.replace(old, new))
    said = subprocess.run([command, "check", file], capture_output=True, text=True)
    assert said.returncode == 2
    with pytest.raises(sc.InputError) as told:
        sc.Session(sc.Scenario.read(file))
    assert said.stderr.strip() == f"spherecut: error: {told.value}"


def test_missing_files_and_taken_folders(tmp_path, small):
    with pytest.raises(sc.InputError, match="nowhere.toml"):
        sc.Scenario.read(tmp_path / "nowhere.toml")
    done = sc.run(small, tmp_path / "run")
    assert "forces.csv" in done.files and (tmp_path / "run" / "summary.json").exists()
    with pytest.raises(sc.InputError, match="run"):
        sc.run(small, tmp_path / "run")


def test_a_session_led_by_hand(source):
    scenario = sc.Scenario.read(source / "scenarios" / "block_slice.toml")
    said = []
    session = sc.Session(scenario, said.append)
    path = session.steps
    results = [session.step(step) for step in path[:6]]
    assert results[-1].cut["area_m2"] > 0 and session.incision.area == results[-1].cut["area_m2"]
    assert len(session.wound.volumes) == results[-1].cut["pieces"] and any("nodes" in line for line in said)
    values = session.node_values()
    assert len(values.displacement) == len(session.nodes)
    seen = session.at(session.nodes.positions[:5])
    assert np.array_equal(seen.displacement, values.displacement[:5])
    states = session.front_states()
    assert states and all(s.toughness == 1.0 for s in states)
    assert all(s.toughness == 7.0 for s in session.front_states(toughness=lambda x: 7.0))
    pose = path[5].blade
    back = session.step(sc.Step(path[5].time - 0.05, None, sc.BladePose(path[5].time - 0.05, pose.position - [0, 0, 0.004])))
    assert back.cut["refused"] and "does not come after" in back.cut["reason"]
    other = scenario.with_random_seed(5)
    assert other.random_seed == 5 and not np.array_equal(sc.Session(other).nodes.positions[-1], sc.Session(scenario).nodes.positions[-1])


def test_toughness_layers_equal_their_function(source):
    """The built-in field of a scenario with layers, and the same as a Python function."""
    scenario = sc.Scenario.read(source / "scenarios" / "liver_tear.toml")
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (50, 3))
    built_in = scenario.toughness_at(points)
    assert np.all(built_in > 0)
    session = sc.Session(sc.Scenario.read(source / "scenarios" / "peel.toml"))
    for step in session.steps[:3]:
        session.step(step)
    scenario = session.scenario
    by_function = session.front_states(toughness=lambda x: float(scenario.toughness_at(x)[0]))
    by_scenario = session.front_states()
    assert by_scenario and [s.toughness for s in by_function] == [s.toughness for s in by_scenario]
    assert [s.release for s in by_function] == [s.release for s in by_scenario]


@pytest.mark.parametrize("name", ["peel.toml", "block_slice.toml"])
def test_a_session_with_a_function_for_its_toughness(source, name):
    """Tears and a blade meet the function: the scenario's own as a function gives the same bits, another one does not."""
    text = (source / "scenarios" / name).read_text()
    if "toughness" not in text:
        text = text.replace("[material]\n", "[material]\ntoughness = 5.0\n")
    scenario = sc.Scenario.from_text(text, source / "scenarios" / name)

    def areas(given):
        session = sc.Session(given)
        results = [session.step(step) for step in session.steps[:8]]
        return [(r.cut or {}).get("area_m2", 0.0) for r in results] + [tuple(r.blade_force) for r in results]

    built_in = areas(scenario)
    assert max(value for value in built_in if isinstance(value, float)) > 0
    assert areas(scenario.with_toughness(lambda x: float(scenario.toughness_at(x)[0]))) == built_in
    assert areas(scenario.with_toughness(1e6)) != built_in
    with pytest.raises(sc.InputError, match="toughness at .*allowed: above 0"):
        areas(scenario.with_toughness(lambda x: -1.0))
    with pytest.raises(sc.InputError, match="pickle"):
        pickle.dumps(scenario.with_toughness(2.0))
    plain = sc.Scenario.from_text(text.replace("toughness = 5.0\n", ""), name) if "5.0\n" in text else None
    if plain is not None and plain.toughness == 0:
        with pytest.raises(sc.InputError, match="no material.toughness"):
            plain.with_toughness(2.0)


def test_a_session_is_not_asked_within_its_step(source):
    held = []

    def ask(line):
        if held:
            held[0].nodes

    session = sc.Session(sc.Scenario.read(source / "scenarios" / "block_slice.toml"), ask)
    held.append(session)
    with pytest.raises(sc.InputError, match="from within its own step"):
        for step in session.steps:
            session.step(step)
