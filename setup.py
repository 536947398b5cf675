"""Builds the compiled module by CMake; everything else is in pyproject.toml.

SPHERECUT_BUILD_FOLDER: a build tree that is there already, whose module is taken (it is brought up to date first).
SPHERECUT_CMAKE_ARGS: arguments for CMake besides, parted by blanks. SPHERECUT_JOBS: compilers at a time.
"""

import os
import shlex
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext


def job_count() -> int:
    """As many as there are cores; a compiler of the topology takes up to 2 GB."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES")
    return max(1, min(os.cpu_count() or 1, int(memory // 2e9)))


class CMakeBuild(build_ext):
    def build_extension(self, extension: Extension) -> None:
        source = Path(__file__).resolve().parent
        folder = os.environ.get("SPHERECUT_BUILD_FOLDER")
        build = Path(folder) if folder else Path(self.build_temp).resolve()
        if not folder:
            arguments = [
                "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DSPHERECUT_BUILD_TESTS=OFF",
                "-DSPHERECUT_BUILD_BENCHMARKS=OFF", f"-DPython3_EXECUTABLE={sys.executable}",
            ]
            arguments += shlex.split(os.environ.get("SPHERECUT_CMAKE_ARGS", ""))
            environment = {"CCACHE_BASEDIR": str(source), "CCACHE_NOHASHDIR": "1"} | os.environ
            subprocess.run(["cmake", "-S", source, "-B", build, *arguments], check=True, env=environment)
        jobs = os.environ.get("SPHERECUT_JOBS", str(job_count()))
        subprocess.run(["cmake", "--build", build, "--target", "spherecut_python", "--parallel", jobs], check=True)
        modules = list((build / "python" / "spherecut").glob("_core.*.so"))
        if len(modules) != 1:
            raise SystemExit("the Python module was not built: pybind11-dev, python3-dev or python3-numpy is missing")
        target = Path(self.get_ext_fullpath(extension.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        self.copy_file(str(modules[0]), str(target))


setup(ext_modules=[Extension("spherecut._core", sources=[])], cmdclass={"build_ext": CMakeBuild})
