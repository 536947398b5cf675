"""The command in a foreign locale, without a terminal, killed at any time, and with recordings that somebody has made up.
The environment has SPHERECUT_COMMAND."""

import os
import pty
import shutil
import signal
import struct
import subprocess
import time
from pathlib import Path

import pytest

PROGRAM = os.environ["SPHERECUT_COMMAND"]
KILLS = 53

SCENARIO = """title = "small"
[organ]
shape = "block"
size = [0.06, 0.06, 0.03]
edge = 0.006
[material]
young_modulus = 1e4
poisson_ratio = 0.3
[[fixed]]
name = "base"
region = "box"
lower = [-1, -1, -0.001]
upper = [1, 1, 0.001]
[nodes]
fine_spacing = 0.006
coarse_spacing = 0.012
fine_radius = 0.006
[tool]
shape = "sphere_tip"
radius = 0.01
step = 0.25
[tool.approach]
target = [0, 0, 0.03]
direction = [0, 0, -1]
depth = 0.002
clearance = 0.001
[output]
vtp_every = 2
figures = false
"""


@pytest.fixture
def scenario(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(SCENARIO, encoding="utf-8")
    return file


def spherecut(*words, **how):
    return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, errors="replace", check=False, **how)


def results(folder):
    """What a run has computed: all but the times that it took."""
    return {"forces.csv": timeless((folder / "forces.csv").read_text(encoding="utf-8"))} | {
        f"frames/{file.name}": file.read_bytes() for file in sorted((folder / "frames").iterdir())
    }


def timeless(rows):
    """Whole rows without what the clock has put into them."""
    assert rows.endswith("\n")
    cells = [row.split(",") for row in rows.splitlines()]
    assert len({len(row) for row in cells}) == 1
    clock = cells[0].index("seconds")
    return [row[:clock] + row[clock + 1 :] for row in cells]


@pytest.fixture
def expected(scenario, tmp_path):
    assert spherecut("run", scenario, "--out", tmp_path / "as ever").returncode == 0
    found = results(tmp_path / "as ever")
    assert len(found) > 3
    return found


@pytest.mark.parametrize("name", ["de_DE", "tr_TR", "hi_IN"])
def test_foreign_locale(name, scenario, expected, tmp_path):
    """Commas for points, a capital I that is none, other digits: the files that are read and written stay as they are."""
    if not shutil.which("localedef"):
        pytest.skip("localedef is not there")
    made = subprocess.run(["localedef", "-i", name, "-f", "UTF-8", tmp_path / f"{name}.UTF-8"], capture_output=True, check=False)
    if not (tmp_path / f"{name}.UTF-8").is_dir():
        pytest.skip(f"{name} cannot be made here (Debian: locales): {made.stderr.decode(errors='replace').strip()}")
    foreign = os.environ | {"LOCPATH": str(tmp_path), "LC_ALL": f"{name}.UTF-8", "LANG": f"{name}.UTF-8"}
    in_force = subprocess.run(["locale", "decimal_point"], env=foreign, capture_output=True, text=True, check=True).stdout
    assert in_force.strip() == {"de_DE": ",", "tr_TR": ",", "hi_IN": "."}[name]
    run = spherecut("run", scenario, "--out", tmp_path / "out", env=foreign)
    assert run.returncode == 0, run.stderr
    assert results(tmp_path / "out") == expected
    for words in [("check", scenario), ("check", tmp_path / "none.toml")]:
        there, here = spherecut(*words, env=foreign), spherecut(*words)
        assert (there.returncode, there.stderr) == (here.returncode, here.stderr)


def test_no_terminal(scenario, expected, tmp_path):
    """Neither a controlling terminal nor anything to read or to write to: a job of a batch system or of cron."""
    # Which kernels the linear algebra takes decides on the last bits of its sums: whoever has chosen them keeps them.
    bare = {"PATH": "/usr/bin:/bin"} | {name: value for name, value in os.environ.items() if name.startswith("OPENBLAS_")}
    run = spherecut("run", scenario, "--out", tmp_path / "a", env=bare, stdin=subprocess.DEVNULL, start_new_session=True)
    assert run.returncode == 0, run.stderr
    assert "\033" not in run.stdout + run.stderr and "\r" not in run.stdout + run.stderr
    assert results(tmp_path / "a") == expected
    # Closed: the next file that is opened gets the number of the standard output. Nothing that is said may go into it.
    closed = subprocess.run(
        ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", PROGRAM, "run", str(scenario), "--out", str(tmp_path / "b")],
        env=bare,
        start_new_session=True,
        check=False,
    )
    assert closed.returncode == 0
    assert results(tmp_path / "b") == expected


def test_terminal(scenario, expected, tmp_path):
    """On a terminal the results are those that there are without one."""
    ours, its = pty.openpty()
    with subprocess.Popen(
        [PROGRAM, "run", scenario, "--out", tmp_path / "a"], stdin=its, stdout=its, stderr=its, start_new_session=True
    ) as run:
        os.close(its)
        try:
            while os.read(ours, 4096):
                pass
        except OSError:  # its other end is closed
            pass
        assert run.wait() == 0
    os.close(ours)
    assert results(tmp_path / "a") == expected


def test_killed_at_any_time(scenario, expected, tmp_path):
    """Whole rows alone, of those that the run would have had; nothing of it stands in the way of the next."""
    began = time.monotonic()
    assert spherecut("run", scenario, "--out", tmp_path / "whole").returncode == 0
    takes = time.monotonic() - began
    ended = 0
    for k in range(KILLS):
        out = tmp_path / f"out{k}"
        with subprocess.Popen(
            [PROGRAM, "run", scenario, "--out", out], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as run:
            time.sleep(takes * k / KILLS)
            run.kill()
            ended += run.wait() == -signal.SIGKILL
        if (out / "forces.csv").exists():
            kept = (out / "forces.csv").read_text(encoding="utf-8")
            assert not kept or timeless(kept) == expected["forces.csv"][: kept.count("\n")], k
        for frame in out.glob("frames/*.vtp"):
            assert frame.read_bytes() == expected[f"frames/{frame.name}"], k
        again = spherecut("run", scenario, "--out", out)
        if not out.exists() or again.returncode == 0:
            assert results(out) == expected
        else:  # it holds results, which are not overwritten
            assert again.returncode == 2
            assert str(out) in again.stderr and len(again.stderr.splitlines()) == 1, again.stderr
    assert ended > KILLS // 2


def checksum(payload):
    value = 0xCBF29CE484222325
    for byte in payload:
        value = ((value ^ byte) * 0x100000001B3) % 2**64
    return value


def lot(kind, payload):
    return struct.pack("<IIQ", kind, len(payload), checksum(payload)) + payload


def text(words):
    words = words.encode() if isinstance(words, str) else words
    return struct.pack("<I", len(words)) + words


class Crafted:
    """A recording with checksums that are right."""

    def __init__(self, version):
        self.version = version
        self.scenario = SCENARIO
        self.name = "/s.toml"
        self.seed, self.organ, self.rate = 1, 0, 1000.0
        self.ticks = [[i, i * 1e-3, 0, 0, 0.05, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0] for i in range(20)]
        self.solves = []
        self.clients = []
        self.end = None
        self.order = "hsct"
        self.more = b""

    def bytes(self):
        lots = {
            "h": lot(1, text("build") + text("processor") + text(self.name) + text(self.scenario) + struct.pack("<QQd", self.seed, self.organ, self.rate)),
            "s": lot(3, b"".join(struct.pack("<QQiIiiQ6d", *solve, 0, 0, 0) for solve in self.solves)) if self.solves else b"",
            "c": lot(5, b"".join(struct.pack("<Q5dQ", *client) for client in self.clients)) if self.clients else b"",
            "t": lot(2, b"".join(struct.pack("<Q11dIHHQ3d", *tick, 0, 0, 0) for tick in self.ticks)) if self.ticks else b"",
        }
        end = self.end or (len(self.ticks), len(self.solves), 0)
        return b"SPHCREC\n" + struct.pack("<II", self.version, 0) + b"".join(lots[k] for k in self.order) + self.more + lot(4, struct.pack("<3Q", *end))


NAN, INF = float("nan"), float("inf")


def changes():
    """Name, and what it does to a recording."""

    def tick(number, field, value):
        def change(made):
            made.ticks[number][field] = value

        return change

    def each(field, value):
        return lambda made: setattr(made, field, value)

    for value in (NAN, INF, -INF, 1e300, -1e300, 1e7):
        for field in (2, 3, 4):
            yield f"position {field} of {value}", tick(7, field, value)
    for value in (NAN, INF):
        for field in (1, 5, 9):
            yield f"number {field} of {value}", tick(3, field, value)
    for value in (0.0, -1.0, NAN, INF, 1e-300, 5e-324, 1e9):
        yield f"rate {value}", each("rate", value)
    yield "an orientation of length 0", tick(4, 8, 0.0)
    yield "an orientation of length 1e150", tick(4, 8, 1e150)
    yield "a tick that is elsewhere", tick(5, 0, 99)
    yield "a tick of another age", tick(5, 0, 2**64 - 1)
    yield "a solve that is not there", tick(5, 15, 1)
    yield "a solve of the end of time", tick(5, 15, 2**64 - 1)
    for solve in ([2, 0], [0, 0], [2**64 - 1, 0], [1, 2**64 - 1]):
        yield f"solve {solve}", lambda made, solve=solve: (
            setattr(made, "solves", [[*solve, 0, 0, 0, 0, 0, 0, 0, 0]]),
            tick(6, 15, 1)(made),
        )
    for level in (-1, 5, 2**31 - 1, -(2**31)):
        yield f"level {level}", each("solves", [[1, 0, level, 0, 0, 0, 0, 0, 0, 0]])
    for client in ([0, NAN, 0, 0, 2, 1, 1], [0, 0, 0, 0, 0, 1, 1], [0, 0, 0, 0, 1e300, 1, 1], [0, 0, 0, 0, 2, -1, 1], [0, 0, 0, 0, 2, NAN, 1]):
        yield f"client {client}", each("clients", [client])
    for end in ((19, 0, 0), (2**64 - 1, 0, 0), (20, 1, 0), (20, 0, 1)):
        yield f"end {end}", each("end", end)
    for order in ("t", "th", "hh", "hht", ""):
        yield f"lots in the order '{order}'", each("order", order)
    yield "a lot behind the end", lambda made: setattr(made, "more", lot(4, struct.pack("<3Q", 20, 0, 0)))
    yield "a lot of no kind", lambda made: setattr(made, "more", lot(77, b"what"))
    yield "half a tick", lambda made: setattr(made, "more", lot(2, b"\0" * 50))
    yield "a lot of 4 GB", lambda made: setattr(made, "more", struct.pack("<IIQ", 2, 2**32 - 1, 0))
    for name, scenario in {
        "none": "",
        "no TOML": "[[[[",
        "not UTF-8": b"title = \"\xff\xfe\"",
        "zeros": b"\0" * 1000,
        "a key of 40,000 parts": ".".join(["a"] * 40_000) + " = 1",
        "100,000 brackets": "a = " + "[" * 100_000,
        "escape sequences": '"\033]0;mine\007" = 1\n' + SCENARIO,
        "no spacing": SCENARIO.replace("fine_spacing = 0.006", "fine_spacing = 5e-324"),
        "endless nodes": SCENARIO.replace("coarse_spacing = 0.012", "coarse_spacing = 1e-9"),
        "a file of the system": SCENARIO.replace('shape = "block"', 'file = "/dev/zero"'),
    }.items():
        yield f"scenario: {name}", each("scenario", scenario)


CHANGES = list(changes())


def test_crafted_recordings(tmp_path, scenario):
    """Refused in words that no terminal obeys, with status 2; and what nobody has altered is read."""
    virtual = spherecut("haptics", scenario, "--out", tmp_path / "a", "--duration", "0.02", "--virtual", "--solved-every", "0")
    assert virtual.returncode == 0, virtual.stderr
    version = struct.unpack_from("<I", (tmp_path / "a" / "haptic.recording").read_bytes(), 8)[0]
    file = tmp_path / "crafted.recording"
    assert len(CHANGES) >= 60
    for number, (name, change) in enumerate([("nothing", lambda made: None), *CHANGES]):
        made = Crafted(version)
        change(made)
        file.write_bytes(made.bytes())
        answer = spherecut("haptics", "--replay", file, "--out", tmp_path / f"out{number}")
        said = answer.stdout + answer.stderr
        if name == "nothing":  # read to its end; the organ is another's
            assert answer.returncode == 2 and "organ" in answer.stderr, answer
            continue
        assert answer.returncode == 2, (name, answer)
        assert answer.stderr.startswith("spherecut: error: ") and len(answer.stderr) < 2000, (name, answer)
        assert "\033" not in said and "\007" not in said, name
        assert "organ" not in answer.stderr or "scenario" in name or "organ." in answer.stderr, (name, answer)

