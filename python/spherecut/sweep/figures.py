"""Figures of a study's table."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Any

import numpy as np

from .._core import InputError
from .study import Figure, key_of, shown
from .table import Row, columns_of


def _column(rows: list[Row], name: str, where: str) -> str:
    """The column that a figure names: as the table has it, or without its summary."""
    columns = columns_of(rows)
    for candidate in (name, f"summary.{name}"):
        if candidate in columns:
            return candidate
    near = difflib.get_close_matches(f"summary.{name}", columns, 3, 0.4)
    raise InputError(f"figure: {where} = {shown(name)}: the table has no such column"
                     + (f"; nearest: {', '.join(c.removeprefix('summary.') for c in near)}" if near else ""))


def _label(column: str) -> str:
    line = key_of(column)
    return f"{column}, {line['unit']}" if line and line["unit"] else column.removeprefix("summary.")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and bool(np.isfinite(value))


def draw(out: Path, rows: list[Row], figure: Figure, title: str) -> Path:
    """Writes a figure; returns its file. Where several runs share x, a line joins their medians."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    x, y = _column(rows, figure.x, "x"), _column(rows, figure.y, "y")
    by = None if figure.by is None else _column(rows, figure.by, "by")
    shared = [row for row in rows if row.get(x) is not None and _is_number(row.get(y))]
    if not shared:
        raise InputError(f"figure: y = {shown(figure.y)}: no run has a number there over {figure.x}")
    is_text = not all(_is_number(row[x]) for row in shared)
    names = list(dict.fromkeys(str(row[x]) for row in shared)) if is_text else []
    groups: dict[Any, list[tuple[float, float]]] = {}
    for row in shared:
        at = float(names.index(str(row[x]))) if is_text else float(row[x])
        groups.setdefault(None if by is None else row.get(by), []).append((at, float(row[y])))
    drawing, axes = pyplot.subplots(figsize=(6.4, 4.4), dpi=120)
    for group, points in sorted(groups.items(), key=lambda item: (not _is_number(item[0]), item[0] if _is_number(item[0]) else str(item[0]))):
        array = np.array(points)
        places = np.unique(array[:, 0])
        medians = [float(np.median(array[array[:, 0] == place, 1])) for place in places]
        (line,) = axes.plot(places, medians, "-", linewidth=1.2, label=None if by is None else f"{group:g}" if _is_number(group) else str(group))
        axes.plot(array[:, 0], array[:, 1], "o", markersize=4, color=line.get_color())
    if is_text:
        axes.set_xticks(range(len(names)), names)
    else:
        axes.set_xscale(figure.x_scale)
    axes.set_yscale(figure.y_scale)
    axes.set_xlabel(_label(x))
    axes.set_ylabel(_label(y))
    if title:
        axes.set_title(title, fontsize=10)
    if by is not None:
        axes.legend(title=_label(by), fontsize=8, title_fontsize=8)
    axes.grid(alpha=0.3)
    drawing.tight_layout()
    stem = figure.name or re.sub(r"[^\w.-]+", "_", f"{figure.y}_over_{figure.x}" + (f"_by_{figure.by}" if figure.by else ""))
    file = out / f"{stem}.{figure.format}"
    drawing.savefig(file)
    pyplot.close(drawing)
    return file
