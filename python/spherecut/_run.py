"""A whole run of a scenario, with what it writes as arrays."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from ._core import Results, Scenario, Session, StepResult

Table = dict[str, npt.NDArray[Any]]


def _table(rows: list[dict[str, Any]]) -> Table:
    """Columns of rows; a column of arrays of different lengths becomes one of objects."""
    if not rows:
        return {}
    table: Table = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        if isinstance(values[0], np.ndarray):
            column = np.empty(len(values), dtype=object)
            column[:] = values
            table[name] = column
        else:
            table[name] = np.array(values)
    return table


def force_columns(results: Iterable[StepResult]) -> Table:
    """Columns of forces.csv as arrays, (steps,)."""
    return _table([result.forces for result in results])


def cut_columns(results: Iterable[StepResult]) -> Table:
    """Columns of cuts.csv as arrays, (steps,); volumes_m3 is an array of arrays, one entry a piece."""
    return _table([result.cut for result in results if result.cut is not None])


def tear_columns(results: Iterable[StepResult]) -> Table:
    """Columns of tears.csv as arrays, (increments,)."""
    return _table([row for result in results if result.tear is not None for row in result.tear])


@dataclass
class Run:
    """What run() has found."""

    session: Session
    results: list[StepResult] = field(default_factory=list)
    files: list[str] = field(default_factory=list)

    @property
    def forces(self) -> Table:
        """Columns of forces.csv, (steps,)."""
        return force_columns(self.results)

    @property
    def cuts(self) -> Table:
        """Columns of cuts.csv, (steps,); empty without cuts."""
        return cut_columns(self.results)

    @property
    def tears(self) -> Table:
        """Columns of tears.csv, (increments,); empty without tears."""
        return tear_columns(self.results)


def _with_progress(steps: list[Any], progress: Optional[bool], title: str) -> Iterator[Any]:
    """The steps, with a bar of tqdm's where that is there; progress None: a bar on a terminal alone."""
    if progress is not False:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            if progress:
                raise
        else:
            yield from tqdm(steps, desc=title, unit="step", disable=None if progress is None else False)
            return
    yield from steps


def run(
    scenario: Union[Scenario, str, os.PathLike[str]],
    out: Union[str, os.PathLike[str], None] = None,
    *,
    progress: Optional[bool] = None,
    say: Optional[Callable[[str], None]] = None,
    after_step: Optional[Callable[[Session, StepResult], None]] = None,
) -> Run:
    """Runs a scenario to its end, as ``spherecut run`` does: same forces, bit by bit.

    scenario: a Scenario or its file. out: a folder for the files of a run; it must not hold results yet. progress: True
    asks for tqdm, None shows a bar on a terminal where tqdm is there. say: function of a line that the session has to
    say. after_step: function of session and result, called after each step. Ctrl-C ends the run: what was written stays,
    with a summary, and KeyboardInterrupt is raised.
    """
    if not isinstance(scenario, Scenario):
        scenario = Scenario.read(scenario)
    session = Session(scenario, say)
    done = Run(session)
    files = None if out is None else Results(out, session)
    try:
        for step in _with_progress(session.steps, progress, scenario.title or "spherecut"):
            result = session.step(step)
            session.require_tissue(result)
            done.results.append(result)
            if files is not None:
                files.add(session, result)
            if after_step is not None:
                after_step(session, result)
    except KeyboardInterrupt:
        if files is not None:
            files.finish(session, "interrupted")
        raise
    except Exception as error:
        if files is not None:
            files.finish(session, "failed", str(error))
        raise
    if files is not None:
        done.files = files.finish(session)
    return done
