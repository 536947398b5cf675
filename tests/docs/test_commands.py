"""Every command in README, CONTRIBUTING and docs/ is tried, as the list below says. A command that it does not know is a
failure, and so is an entry of the list that no page has any more. The environment has SPHERECUT_SOURCE, SPHERECUT_BUILD,
SPHERECUT_COMMAND."""

import functools
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from commands import Command, Written, commands_of, pages, words

SOURCE = Path(os.environ["SPHERECUT_SOURCE"])
BUILD = Path(os.environ["SPHERECUT_BUILD"])
PROGRAM = Path(os.environ["SPHERECUT_COMMAND"])
STANDS_FOR = {"STUDY.toml": "examples/studies/press_spacing.toml", "SCENARIO.toml": "scenarios/block_punch.toml", "SCENARIO": "scenarios/block_punch.toml"}
S = r"(?:build/release/)?spherecut"
SMALL = "scenarios/small.toml"  # in the scratch copy: block_punch on fewer nodes

# How a command is tried. The first entry whose pattern is the whole command counts.
#   run          in a scratch copy of the repository, after what the page has before it; it must end with 0
#   run_python   likewise, where the Python package is built and matplotlib is there
#   run_short    likewise, with words replaced so that it takes seconds and neither the network nor the clock
#   run_coarse   likewise, and the scenario has fewer triangles, nodes and steps (coarser() below)
#   quick        likewise, with --quick where that takes a second or two; of the other experiments the suite runs the same
#                variant (tests/experiments), which must be there, and the command must be one that parse() takes
#   serve        likewise, on any free port: the page comes over HTTP, a browser is opened where it is asked for, and SIGTERM
#                ends it with 0
#   help         the name of a subcommand within a sentence: it must say its help
#   run_study    likewise, where the Python package is built, as far as --dry-run goes: every run is checked and listed
#   dev          ./dev has that command and those options: each builds something, for minutes to an hour, or is this suite
#                itself; tests/src/run/test_dev_script.cpp runs the script
#   ctest        some test has that name
#   page_tests   tests/page/run.sh has that kind of test (ctest runs them)
#   targets      CMake has that preset, that option, that target
#   elsewhere    the test named behind it runs it
#   clone        the folder that is cloned into is the one that is entered
#   packages     the files have the names that packing gives them; scripts/deb_in_a_bare_root.sh is what tries it
HOW = [
    (rf"{S} check scenarios/\w+\.toml", "run"),
    (rf"{S} check press\.toml", "run"),
    (rf"{S} run press\.toml --out out/press", "run"),
    (rf"{S} run scenarios/(?:block_punch|block_slice)\.toml --out out/\w+", "run"),
    (rf"{S} run scenarios/liver\.toml --out out/liver", "run"),
    (rf"{S} experiment list", "run"),
    (rf"{S} scenario-help(?: --markdown)?", "run"),
    (r"\{ sed .*scenario-help --markdown; \} > page\.md && mv page\.md docs/scenario\.md", "run"),
    (rf"{S} check SCENARIO\.toml", "run"),
    (rf"{S} check SCENARIO --write mended\.obj", "run"),
    (rf"{S} run SCENARIO\.toml --out DIR", "run"),
    (rf"{S} experiment run hertz --out out/hertz", "run_short", {"hertz": "hertz --quick"}),
    (rf"{S} haptics scenarios/liver_soft_live\.toml --duration 10 --out out/hand", "run_short", {"--duration 10": "--duration 0.3 --virtual"}),
    (r"PYTHONPATH=build/release/python python3 examples/python/press_a_liver\.py --out \.", "run_python"),
    (r"cmake --install build/release --prefix DIR", "elsewhere", "tests/install_consumer/CMakeLists.txt", "--prefix"),
    (r"cmake --install build/release --component python", "elsewhere", "tests/python/test_package.py", "--component"),
    (r"cmake -S examples/libraries -B mine -DCMAKE_PREFIX_PATH=DIR && cmake --build mine", "elsewhere", "tests/install_consumer/CMakeLists.txt",
     "examples/libraries"),
    (r"cmake --install", "elsewhere", "tests/install_consumer/CMakeLists.txt", "--install"),
    (r"pip install --no-build-isolation \.", "elsewhere", "tests/python/test_package.py", "--no-build-isolation"),
    (r"python3 -m venv --system-site-packages env && \. env/bin/activate", "run_short",
     {"--system-site-packages": "--system-site-packages --without-pip"}),
    (rf"{S} experiment run NAME --out DIR \[--quick\]", "run_short", {"NAME": "patch_test", "[--quick]": "--quick"}),
    (rf"{S} experiment run \w+ --out DIR", "quick"),
    (rf"{S} run scenarios/\w+\.toml --out (?:DIR|out/soft)", "run_coarse"),
    (rf"{S} run scenarios/liver(?:_live)?\.toml", "run_coarse", {".toml": ".toml --out out/named"}),
    (rf"{S} run /usr/share/spherecut/scenarios/liver_cut\.toml --out out/demo", "run_coarse", {"/usr/share/spherecut/": ""}),
    (rf"{S} serve --open", "serve"),
    (rf"{S} serve \[SCENARIO\.toml\].*", "serve"),
    (rf"{S} haptics SCENARIO\.toml --duration S --out DIR", "run_short", {"SCENARIO.toml": SMALL, "--duration S": "--virtual --duration 0.3"}),
    (rf"{S} haptics SCENARIO\.toml --duration 60 --out DIR", "run_short", {"SCENARIO.toml": SMALL, "--duration 60": "--virtual --duration 0.3"}),
    (rf"{S} haptics --replay DIR/haptic\.recording --out OTHER", "run"),
    (rf"{S} haptics --replay FILE", "run_short", {
        "haptics --replay FILE": f"haptics {SMALL} --virtual --duration 0.3 --out made && spherecut haptics --replay made/haptic.recording --out again"}),
    (r"spherecut (?:run|check|sweep|haptics|serve)", "help"),
    (rf"{S} sweep examples/studies/press_spacing\.toml --out out/\w+(?: --slurm)?", "run_study"),
    (rf"{S} sweep STUDY\.toml --out FOLDER -- .*", "run_study"),
    (r"PYTHONPATH=build/release/python python3 examples/studies/threads\.py", "run_short", {"examples/studies/threads.py": "examples/studies/threads.py 300"}),
    (r"PYTHONPATH=build/release/python python3 examples/studies/environment_rate\.py", "run_short", {"environment_rate.py": "environment_rate.py 20"}),
    (r"python3 -m spherecut\.sweep", "elsewhere", "tests/python/test_sweep.py", "spherecut.sweep"),
    (r"python3 examples/studies/scaling\.py examples/studies/press_spacing\.toml", "run_short", {"examples/studies/press_spacing.toml": "--help"}),
    (r"python3 benchmarks/cutbench/derive\.py", "run"),
    (r"python3 benchmarks/cutbench/score\.py benchmarks/cutbench/results/spherecut\.json benchmarks/cutbench/results/calculix\.json", "elsewhere",
     "tests/cutbench/test_cutbench.py", '(FOLDER / "results").glob("*.json")'),
    (r"PYTHONPATH=build/release/python python3 benchmarks/cutbench/run_spherecut\.py --out spherecut\.json", "elsewhere", "tests/cutbench/test_cutbench.py",
     '"run_spherecut.py", "--coarse"'),
    (r"python3 benchmarks/cutbench/to_calculix\.py --out calculix --run --result calculix\.json", "elsewhere", "tests/cutbench/calculix.sh",
     "--run --result"),
    (r"python3 benchmarks/cutbench/to_sofa\.py --out scenes", "run_short", {"scenes": "scenes severed_bar"}),
    (r"git clone ADDRESS \w+ && cd \w+", "clone"),
    (r"\./dev \w+.*", "dev"),
    (r"\.ci/run", "elsewhere", ".ci/run", "./dev test"),
    (r"ctest .*", "ctest"),
    (r"tests/page/run\.sh build/release \w+.*", "page_tests"),
    (r"build/release/tests/haptic_bridge_client/haptic_bridge_client 27510 60", "elsewhere", "tests/CMakeLists.txt", "SPHERECUT_BRIDGE_CLIENT"),
    (r"cmake -S examples/haptic_bridge_client -B client && cmake --build client", "run"),
    (r"cmake -S examples/devices -B devices && cmake --build devices", "run"),
    (rf"{S} haptics SCENARIO\.toml --bench --out DIR", "run_short", {"SCENARIO.toml": SMALL, "--bench": "--bench --virtual", "DIR": "BENCH"}),
    (r"cmake --preset release -DSPHERECUT_BUILD_REFERENCES=ON", "targets"),
    (r"ninja -C build/release spherecut_reference_getfem", "targets"),
    (r"build/release/spherecut_reference_getfem 0\.\d+ experiments/hemisphere_palpation/reference_nu\d+\.csv", "targets"),
    (r"sudo apt install \./spherecut_.*\.deb", "packages"),
    (r"sudo scripts/deb_in_a_bare_root\.sh build/release/spherecut_.*\.deb out/bare_root", "packages"),
]


def how(text: str):
    for pattern, *rest in HOW:
        if re.fullmatch(pattern, text, re.S):
            return rest
    return None


def everything() -> list[Command | Written]:
    return [entry for page in pages(SOURCE) for entry in commands_of(SOURCE, page)]


def said_by(*command: str, cwd: Path = SOURCE) -> str:
    done = subprocess.run([str(word) for word in command], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(map(str, command))}: {done.stdout}{done.stderr}"
    return done.stdout


@functools.cache
def help_of(*subcommands: str) -> str:
    return said_by(PROGRAM, *subcommands, "--help")


@functools.cache
def experiments() -> set[str]:
    return set(said_by(PROGRAM, "experiment", "list", "--names").split())


@functools.cache
def check_scenario(file: str) -> None:
    assert (SOURCE / file).is_file(), f"{file} is not there"
    said_by(PROGRAM, "check", file)


@functools.cache
def test_names() -> list[str]:
    """Of the sources: in a tree that is built in part, ctest does not know them."""
    cpp = "".join(file.read_text() for file in (SOURCE / "tests").rglob("*.cpp"))
    cmake = "".join(file.read_text() for file in (SOURCE / "tests").rglob("CMakeLists.txt"))
    names = re.findall(r'^TEST_CASE\(\s*"((?:[^"\\]|\\.|"\s*")*)"', cpp, re.M)
    return [re.sub(r'"\s*"', "", name) for name in names] + re.findall(r'add_test\(NAME "([^"]+)"', cmake)


test_names.__test__ = False

# --- the ways of trying


def parse(text: str) -> None:
    """Of a command of the program: that its subcommand, options, files and experiment are there."""
    _, *rest = words(text)
    subcommands = []
    while rest and not rest[0].startswith("-") and re.search(rf"^  {re.escape(rest[0])}\s", help_of(*subcommands).partition("Subcommands:")[2], re.M):
        subcommands.append(rest.pop(0))
    assert subcommands, f"'{text}': no such subcommand"
    options = help_of(*subcommands)
    takes_subcommand = "Subcommands:" in options
    assert not (takes_subcommand and rest), f"'{text}': '{rest[0]}' is none of its subcommands"
    positionals = []
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            positionals.append(word)
            continue
        found = re.search(rf"^  (?:-\w,)?{re.escape(word)}(?: ([A-Z]+)\b)?", options, re.M)
        assert found, f"'{text}': {' '.join(subcommands)} has no option {word}"
        if found[1]:
            assert rest and not rest[0].startswith("--"), f"'{text}': {word} needs a value"
            rest.pop(0)
    assert not positionals or "Positionals:" in options, f"'{text}': '{positionals[0]}' is too much"
    assert len(positionals) <= 1, f"'{text}': '{positionals[-1]}' is too much"
    for word in positionals:
        if subcommands == ["experiment", "run"]:
            assert word == "NAME" or word in experiments(), f"'{text}': there is no experiment '{word}'"
        else:
            check_scenario(STANDS_FOR.get(word, word.replace("/usr/share/spherecut/", "")))


def dev(text: str) -> None:
    listed = said_by(SOURCE / "dev", "--help")
    _, command, *rest = words(text)
    entry = re.search(rf"^  {re.escape(command)}(?: \S+)*", listed, re.M)
    assert entry, f"'{text}': ./dev has no command '{command}'"
    for word in rest:
        known = word in entry[0] or (command == "test" and word.startswith("-"))
        assert known or not word.startswith("-"), f"'{text}': ./dev {command} has no option {word}"
        assert known or re.search(r"\[[A-Z]", entry[0]), f"'{text}': ./dev {command} takes no '{word}'"


def ctest(text: str) -> None:
    given = words(text)
    pattern = given[given.index("-R") + 1]
    assert set(given) - {pattern} <= {"ctest", "-R", "--test-dir", "build/release"}, text
    assert any(re.search(pattern, name) for name in test_names()), f"'{text}': no test has such a name"


def page_tests(text: str) -> None:
    kind = words(text)[2]
    assert re.search(rf"^#   {re.escape(kind)}\b", (SOURCE / "tests/page/run.sh").read_text(), re.M), f"'{text}': no such kind"


def targets(text: str) -> None:
    given = words(text)
    if given[0] == "cmake":
        assert f'"{given[2]}"' in said_by("cmake", "--list-presets"), text
        name = given[3].removeprefix("-D").partition("=")[0]
        assert f"option({name} " in (SOURCE / "CMakeLists.txt").read_text(), f"'{text}': there is no option {name}"
        return
    name = given[3] if given[0] == "ninja" else given[0].rsplit("/", 1)[1]
    lists = "".join(file.read_text() for file in (SOURCE / "experiments").rglob("CMakeLists.txt"))
    assert f"add_executable({name}" in lists, f"'{text}': there is no target {name}"
    for file in given[2:] if given[0] != "ninja" else []:
        assert (SOURCE / file).is_file(), f"'{text}': {file} is not there"


def elsewhere(text: str, file: str, has: str) -> None:
    assert has in (SOURCE / file).read_text(), f"'{text}': {file} does not try it any more (it has no '{has}')"


def packages(text: str) -> None:
    version = re.search(r"project\(spherecut VERSION ([\d.]+)", (SOURCE / "CMakeLists.txt").read_text())[1]
    for word in words(text):
        if word.endswith(".deb"):
            assert word.rsplit("/", 1)[1] == f"spherecut_{version}_amd64.deb", f"'{text}': the version is {version}"
        if word.startswith("scripts/"):
            assert os.access(SOURCE / word, os.X_OK), f"'{text}': {word} is not there"
            assert subprocess.run([SOURCE / word], capture_output=True).returncode == 2  # says how it is used


def clone(text: str) -> None:
    given = words(text)
    assert given[3] == given[-1] and (SOURCE / "dev").is_file(), f"'{text}': it does not enter what it cloned"


def scratch_copy(folder: Path) -> Path:
    """What commands of a reader find in their clone, and the program on the PATH."""
    for name in ["scenarios", "examples", "docs", "benchmarks"]:
        shutil.copytree(SOURCE / name, folder / name, ignore=shutil.ignore_patterns("images", "__pycache__"))
    (folder / SMALL).write_text(coarser((folder / "scenarios" / "block_punch.toml").read_text()))
    (folder / "build").mkdir()
    (folder / "build" / "release").symlink_to(BUILD)
    return folder


def run(text: str, folder: Path) -> None:
    for word, value in STANDS_FOR.items():
        text = re.sub(rf"\b{re.escape(word)}(?![\w.])", value, text)
    environment = os.environ | {"PATH": f"{PROGRAM.parent}:{Path(sys.executable).parent}:{os.environ['PATH']}", "MPLCONFIGDIR": str(folder / "mpl"), "MPLBACKEND": "Agg",
                                "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONPATH", None)
    done = subprocess.run(["bash", "-c", text], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"'{text}' ended with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}"


def shortened(text: str, words_for: dict[str, str]) -> str:
    for long, short in words_for.items():
        assert long in text, f"'{text}' has no '{long}'"
        before = r"(?<!/)" if long[0].isalnum() else ""
        text = re.sub(before + re.escape(long) + (r"\b" if long[-1].isalnum() else ""), lambda _: short, text, count=1)
    return text


# What makes runs of the scenarios that come along last seconds: factors, and a shorter lift of the flap.
COARSER = {"fine_spacing": 2, "coarse_spacing": 1.5, "step": 4}


def coarser(text: str) -> str:
    text = re.sub(r"^triangles = \d+", "triangles = 2000", text, flags=re.M)
    for key, times in COARSER.items():
        text = re.sub(rf"^{key} = ([\d.]+)", lambda found: f"{key} = {times * float(found[1]):g}", text, flags=re.M)
    return text.replace("[-0.060, 0.003, 0.0710]", "[-0.060, 0.003, 0.0660]")


def run_coarse(text: str, folder: Path, words_for: dict[str, str]) -> None:
    text = shortened(text, words_for)
    file = folder / re.search(r"scenarios/\w+\.toml", text)[0]
    as_shipped = file.read_text()
    assert coarser(as_shipped) != as_shipped
    file.write_text(coarser(as_shipped))
    run(text, folder)
    file.write_text(as_shipped)


# Experiments whose quick variant takes two seconds of one core at most.
QUICK = {"patch_test", "smooth_convergence", "punch", "hertz", "hemisphere_palpation", "precut_straight", "precut_edge",
         "precut_beam", "sever", "spacing_independence"}


def quick(text: str, folder: Path) -> None:
    name = words(text)[3]
    if name in QUICK:
        run(f"{text} --quick", folder)
    else:
        parse(text)
        elsewhere(text, "tests/experiments/test_quick_experiments.cpp", f'require_quick_run_passes("{name}"')


def get(url: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(url, timeout=60) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def serve(text: str, folder: Path) -> None:
    """On a small block; a stand-in for the browser says what it was given."""
    seen = folder / "opened"
    (folder / "bin").mkdir(exist_ok=True)
    (folder / "bin" / "xdg-open").write_text(f'#!/bin/sh\nprintf %s "$1" >"{seen}.part" && mv "{seen}.part" "{seen}"\n')
    (folder / "bin" / "xdg-open").chmod(0o755)
    page = BUILD / "page"
    if "[" in text:
        text = text.replace("[", "").replace("]", "").replace("8080", "0")
        text = text.replace("--page DIR", f"--page {page}") if page.is_dir() else text.replace(" --page DIR", "")
        (folder / "DIR").mkdir(exist_ok=True)
    else:
        text += " SCENARIO.toml --port 0"
    command = [str(PROGRAM)] + words(text.replace("SCENARIO.toml", SMALL))[1:]
    environment = os.environ | {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as server:
        said, url = [], None
        try:
            for line in server.stdout:
                said.append(line)
                url = url or re.search(r"serving at (http://127\.0\.0\.1:\d+/)", line)
                if "Ctrl-C ends it" in line:
                    break
            assert url, f"'{text}' does not say where it serves:\n{''.join(said)}"
            status, body = get(url[1])
            if page.is_dir():
                assert status == 200 and "<html" in body and re.search(r'src="[^"]+\.js"', body), f"'{text}': {status} {body[:500]}"
                script = re.search(r'src="\.?/?([^"]+\.js)"', body)[1]
                assert get(url[1] + script)[0] == 200, f"'{text}': the page's {script} does not come"
            else:
                assert status == 404 and "The page is not built" in body, f"'{text}': {status} {body[:500]}"
            assert get(url[1] + "nothing.js")[0] == 404
            while not seen.exists():  # the test's own limit of time ends it
                assert server.poll() is None
                time.sleep(0.01)
            assert seen.read_text() == url[1]
            seen.unlink()
        except BaseException:
            server.kill()
            raise
        server.send_signal(signal.SIGTERM)
        said.append(server.communicate()[0])
    assert server.returncode == 0 and said[-1].rstrip().endswith("ended"), f"'{text}': {server.returncode}\n{''.join(said)}"


def can_draw() -> bool:
    return bool(list((BUILD / "python" / "spherecut").glob("_core*.so"))) and importlib.util.find_spec("matplotlib") is not None


WAYS = {"dev": dev, "ctest": ctest, "page_tests": page_tests, "targets": targets, "elsewhere": elsewhere,
        "packages": packages, "clone": clone}


# --- the tests


def test_every_command_is_in_the_list():
    unknown = [str(entry) for entry in everything() if isinstance(entry, Command) and how(entry.text) is None]
    assert not unknown, "say in HOW how these are tried:\n" + "\n".join(unknown)


def test_every_entry_of_the_list_is_a_command():
    texts = [entry.text for entry in everything() if isinstance(entry, Command)]
    unused = [pattern for pattern, *_ in HOW if not any(re.fullmatch(pattern, text, re.S) for text in texts)]
    assert not unused, "no page has these any more:\n" + "\n".join(unused)


def test_there_are_commands():
    kinds = [how(entry.text)[0] for entry in everything() if isinstance(entry, Command) and how(entry.text)]
    assert len(kinds) > 80 and kinds.count("run") >= 10


@pytest.mark.parametrize("page", pages(SOURCE), ids=lambda page: str(page.relative_to(SOURCE)))
def test_commands_of(page, tmp_path):
    entries = commands_of(SOURCE, page)
    if not entries:
        return
    folder = None
    for entry in entries:
        if isinstance(entry, Command):
            way, *arguments = how(entry.text) or ["none"]
            assert way != "none", f"{entry}: say in HOW how it is tried"
        if isinstance(entry, Written) or way.startswith("run") or way in ("quick", "serve"):
            folder = folder or scratch_copy(tmp_path)
        try:
            if isinstance(entry, Written):
                (folder / entry.name).write_text(entry.text)
            elif way == "run" or (way == "run_python" and can_draw()):
                run(entry.text, folder)
            elif way == "run_short":
                run(shortened(entry.text, arguments[0]), folder)
            elif way == "run_coarse":
                run_coarse(entry.text, folder, *(arguments or [{}]))
            elif way in ("quick", "serve"):
                {"quick": quick, "serve": serve}[way](entry.text, folder)
            elif way == "help":
                said = said_by(PROGRAM, *words(entry.text)[1:], "--help")
                assert re.search(r"^usage: spherecut \w+", said, re.I | re.M), said
            elif way == "run_study" and can_draw():
                run(entry.text.replace(" --out", " --dry-run --out", 1), folder)
            elif way not in ("run_python", "run_study"):
                WAYS[way](entry.text, *arguments)
        except AssertionError as error:
            raise AssertionError(f"{entry}\n{error}") from None


# The ways must see what is wrong.
@pytest.mark.parametrize("text", [
    "spherecut frobnicate", "spherecut run scenarios/none.toml", "spherecut run scenarios/liver.toml --output DIR",
    "spherecut run scenarios/liver.toml more.toml", "spherecut experiment run herz --out DIR", "spherecut haptics --replay",
    "spherecut experiment show", "spherecut scenario-help --json",
])
def test_parse_refuses(text):
    with pytest.raises(AssertionError):
        parse(text)


@pytest.mark.parametrize("way, text", [
    ("dev", "./dev frobnicate"), ("dev", "./dev lint --shallow"), ("dev", "./dev demo liver"),
    ("ctest", 'ctest -R "no test has this name"'), ("page_tests", "tests/page/run.sh build/release nothing"),
    ("targets", "cmake --preset fast -DSPHERECUT_BUILD_REFERENCES=ON"), ("targets", "cmake --preset release -DSPHERECUT_NOTHING=ON"),
    ("targets", "ninja -C build/release spherecut_nothing"), ("packages", "sudo apt install ./spherecut_9.9.9_amd64.deb"),
    ("clone", "git clone ADDRESS spherecut && cd elsewhere"),
])
def test_others_refuse(way, text):
    with pytest.raises(AssertionError):
        WAYS[way](text)


def test_run_refuses(tmp_path):
    with pytest.raises(AssertionError):
        run("spherecut check scenarios/none.toml", scratch_copy(tmp_path))


def test_an_unknown_command_on_a_page_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("Text with `spherecut paint liver`.\n\n```sh\n./dev demo   # why\nspherecut bake \\\n  --hot\n```\n\n    spherecut fry # it\n")
    found = [entry.text for entry in commands_of(tmp_path, page)]
    assert found == ["spherecut paint liver", "./dev demo", "spherecut bake \\\n--hot", "spherecut fry"]
    assert [how(text) is None for text in found] == [True, False, True, True]
