"""Studies: a scenario over a grid, a list or a Latin hypercube of its keys, run by Snakemake, one table of all summaries.

``spherecut sweep STUDY.toml --out FOLDER`` and ``python3 -m spherecut.sweep`` are the same; docs/sweep.md has the format.
"""

from .command import main
from .study import Figure, Run, Study, read_study

__all__ = ["Figure", "Run", "Study", "main", "read_study"]
