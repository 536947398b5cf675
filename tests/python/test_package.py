"""The package itself: stubs, docstrings, installation, pip."""

import ast
import inspect
import os
import subprocess
import sys

import pytest
import spherecut as sc
from conftest import BUILD, SOURCE


def clean_environment():
    return {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONDONTWRITEBYTECODE")}


def test_stubs_are_those_of_the_module():
    said = subprocess.run([sys.executable, SOURCE / "python" / "make_stubs.py", BUILD / "python", "--check"],
                          capture_output=True, text=True)
    assert said.returncode == 0, said.stdout + said.stderr
    tree = ast.parse((SOURCE / "python" / "spherecut" / "_core.pyi").read_text())
    named = {node.name for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert named == {name for name in vars(sc._core) if not name.startswith("_")}


def test_types_hold():
    pytest.importorskip("mypy")
    said = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "--cache-dir", os.devnull,
                           SOURCE / "python" / "spherecut"], capture_output=True, text=True, cwd=SOURCE)
    assert said.returncode == 0, said.stdout + said.stderr


def test_everything_says_what_it_is():
    silent = []
    for name in sc.__all__:
        member = getattr(sc, name)
        if name == "__version__":
            continue
        if not (member.__doc__ or "").strip():
            silent.append(name)
        if inspect.isclass(member) and not issubclass(member, BaseException) and not hasattr(member, "__members__"):
            for key, inner in vars(member).items():
                if not key.startswith("_") and callable(getattr(inner, "__func__", inner)):
                    lines = [line for line in (getattr(member, key).__doc__ or "").split("\n") if line.strip()]
                    if not lines or (lines[0].startswith(key + "(") and len(lines) < 2):
                        silent.append(f"{name}.{key}")
    assert silent == []


def test_cmake_installs_it_where_python_finds_it(tmp_path):
    subprocess.run(["cmake", "--install", BUILD, "--prefix", tmp_path / "usr", "--component", "python"], check=True,
                   capture_output=True)
    (place,) = (tmp_path / "usr").glob("lib/python*/*-packages")
    if os.path.isdir("/usr/lib/python3/dist-packages"):  # Debian's
        assert "/usr/local/" + str(place.relative_to(tmp_path / "usr")) in sys.path
    said = subprocess.run([sys.executable, "-c", "import spherecut; print(spherecut.__file__, spherecut.make_block([0]*3, [1]*3, 1).volume)"],
                          env=clean_environment() | {"PYTHONPATH": str(place)}, cwd=tmp_path, capture_output=True, text=True)
    assert said.returncode == 0 and str(place) in said.stdout and " 1.0" in said.stdout, said.stderr


def test_pip_makes_a_wheel_without_network(tmp_path):
    """The compiled module is that of this build: a clone compiles its own by the same setup.py."""
    copy = tmp_path / "clone"
    copy.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "python"):
        (copy / name).symlink_to(SOURCE / name)
    if subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True).returncode:
        pytest.skip("pip is not there (python3-pip)")
    said = subprocess.run(
        [sys.executable, "-m", "pip", "install", "--no-index", "--no-build-isolation", "--no-deps", "--target", tmp_path / "site", "."],
        cwd=copy, env=clean_environment() | {"SPHERECUT_BUILD_FOLDER": str(BUILD)}, capture_output=True, text=True)
    assert said.returncode == 0, said.stdout + said.stderr
    files = {file.name for file in (tmp_path / "site" / "spherecut").iterdir()}
    assert {"__init__.py", "env.py", "_run.py", "py.typed", "_core.pyi"} <= files
    used = subprocess.run([sys.executable, "-c", "import spherecut.env; print(spherecut.__file__, spherecut.make_liver(1000).volume)"],
                          env=clean_environment() | {"PYTHONPATH": str(tmp_path / "site")}, cwd=tmp_path, capture_output=True, text=True)
    assert used.returncode == 0 and str(tmp_path / "site") in used.stdout, used.stderr
