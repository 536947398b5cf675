"""One table of all runs: how each ended, its keys, and everything in its summary.json."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from typing import Any

from .study import flat

RECORD = ("status", "reason", "exit_status", "seconds", "cpu_seconds", "host")
NOT_RUN = "not run"

Row = dict[str, Any]


def _json(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def record_of(folder: Path) -> dict[str, Any]:
    """record.json of a run; empty where the run has none yet."""
    return _json(folder / "record.json")


def rows_of(out: Path, runs: list[dict[str, Any]]) -> list[Row]:
    """A row for each run, whether it ran or not. runs: dicts of run, its number, and values."""
    rows = []
    for run in runs:
        folder = out / "runs" / run["run"]
        record = record_of(folder)
        row: Row = {"run": run["run"], "status": NOT_RUN} | {name: record[name] for name in RECORD if name in record}
        for key, value in run["values"].items():
            row.update(flat(value, key))
        if record:
            row.update(flat(_json(folder / "result" / "summary.json"), "summary"))
        rows.append(row)
    return rows


def columns_of(rows: list[Row]) -> list[str]:
    """Every column of any row; a column comes after the one that it follows in the first row that has it."""
    order: list[str] = ["run", *RECORD]
    known = set(order)
    for row in rows:
        if row.keys() <= known:
            continue
        before = "host"
        for name in row:
            if name not in known:
                order.insert(order.index(before) + 1, name)
                known.add(name)
            if name not in ("run", *RECORD):
                before = name
    return order


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else value


def write_csv(file: Path, rows: list[Row]) -> None:
    """Texts are quoted, a cell without a value is empty. The file is there as a whole or as it was."""
    columns = columns_of(rows)
    part = file.with_name(file.name + ".part")
    with part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, quoting=csv.QUOTE_MINIMAL, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_cell(row.get(name)) for name in columns] for row in rows)
    os.replace(part, file)


def _column(values: list[Any]) -> list[Any]:
    """Of one kind: numbers become doubles where they are mixed, everything else text."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) <= 1:
        return values
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(_cell(value)) for value in values]


def write_parquet(file: Path, rows: list[Row]) -> bool:
    """The same for pyarrow; False where that is not there."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return False
    columns = {name: _column([row.get(name) for row in rows]) for name in columns_of(rows)}
    part = file.with_name(file.name + ".part")
    pyarrow.parquet.write_table(pyarrow.table(columns), str(part))
    os.replace(part, file)
    return True
