"""Spherecut: cutting and tearing of soft tissue without remeshing.

Everything is in SI units: metres, newtons, pascals, seconds, joules. Arrays are numpy's. What cannot be used raises
InputError (a ValueError), a computation that fails NumericalError (an ArithmeticError), in the words of the command line.
Long calls let other threads run, and Ctrl-C ends them.

docs/python.md has a worked example.
"""

from . import _core
from ._core import *  # noqa: F401,F403
from ._core import __version__
from ._law import material_of_law
from ._run import Run, cut_columns, force_columns, run, tear_columns

__all__ = sorted(
    [name for name in dir(_core) if not name.startswith("_")]
    + ["Run", "run", "force_columns", "cut_columns", "tear_columns", "material_of_law", "__version__"]
)
