"""A study file and its points: what is run, before anything runs."""

from __future__ import annotations

import copy
import difflib
import functools
import hashlib
import itertools
import json
import re
import stat
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from .._core import InputError, Scenario, scenario_keys

MOST_RUNS = 100_000
MOST_BYTES = 4_194_304  # of a study or scenario
MOST_LEVELS = 32  # of tables and arrays in one another
COMPONENTS = ("[x, y, z]", "three or six numbers")  # kinds of keys whose components may be named by [i]
FILE_KEYS = ("organ.file", "precut[].file")


@functools.cache
def key_lines() -> dict[str, dict[str, str]]:
    """Every key of a scenario by its path."""
    return {key["path"]: key for key in scenario_keys()}


@dataclass(frozen=True)
class Figure:
    """A figure of the table: a column over a key, a line for each value of another."""

    x: str
    y: str
    by: Optional[str] = None
    name: str = ""
    x_scale: str = "linear"
    y_scale: str = "linear"
    format: str = "png"


@dataclass(frozen=True)
class Run:
    """A point of a study."""

    values: dict[str, Any]  # of the keys that the study varies
    scenario: dict[str, Any]  # as a whole; names of files are absolute
    identity: str  # equal for equal scenarios, whatever the folder they are in


@dataclass(frozen=True)
class Study:
    """A study file, expanded."""

    file: Path
    title: str
    scenario_file: Path
    keys: list[str]
    runs: list[Run]
    figures: list[Figure] = field(default_factory=list)


def shown(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{quoted(k)} = {shown(v)}" for k, v in value.items()) + " }" if value else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(shown(v) for v in value) + "]"
    return repr(value) if isinstance(value, (int, float)) else str(value)


def quoted(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else shown(key)


def toml_text(table: dict[str, Any], path: str = "") -> str:
    """A table as TOML: its values, then its tables."""
    tables = {k: v for k, v in table.items() if isinstance(v, dict)}
    arrays = {k: v for k, v in table.items() if isinstance(v, list) and v and all(isinstance(e, dict) for e in v)}
    text = "".join(f"{quoted(k)} = {shown(v)}\n" for k, v in table.items() if k not in tables and k not in arrays)
    for key, inner in tables.items():
        text += f"\n[{path}{quoted(key)}]\n" + toml_text(inner, f"{path}{quoted(key)}.")
    for key, entries in arrays.items():
        for inner in entries:
            text += f"\n[[{path}{quoted(key)}]]\n" + toml_text(inner, f"{path}{quoted(key)}.")
    return text


def parts_of(path: str) -> list[Any]:
    """'fixed[0].lower' as ['fixed', 0, 'lower']; empty where it is no path."""
    if not re.fullmatch(r"[A-Za-z_]\w*(\[\d+\])*(\.[A-Za-z_]\w*(\[\d+\])*)*", path):
        return []
    return [int(number) if number else name for name, number in re.findall(r"([A-Za-z_]\w*)|\[(\d+)\]", path)]


def flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Everything in tables and arrays: ('nodes.zones[0].density', 1.01)."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flat(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from flat(inner, f"{path}[{number}]")
    else:
        yield path, value


def key_of(path: str) -> Optional[dict[str, str]]:
    """The line of docs/scenario.md that a key of a study is about, or None."""
    if not parts_of(path):
        return None
    key = key_lines().get(re.sub(r"\[\d+\]", "[]", path))
    if key is None and path.endswith("]"):
        key = key_lines().get(re.sub(r"\[\d+\]", "[]", path[: path.rindex("[")]))
        if key is not None and key["type"] not in COMPONENTS:
            return None
    return None if key is None or "table" in key["type"] else key


def is_component(path: str) -> bool:
    return path.endswith("]")


class _Reader:
    def __init__(self, file: Path) -> None:
        self.file = file

    def refuse(self, where: str, value: Any, allowed: str) -> InputError:
        given = shown(value)
        return InputError(f"{self.file}: {where} = {given if len(given) < 80 else given[:76] + ' ...'}: {allowed}")

    def table(self, value: Any, where: str, allowed: tuple[str, ...]) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.refuse(where, value, "must be a table")
        for key in value:
            if key not in allowed:
                name = f"{where}.{key}" if where else key
                raise InputError(f"{self.file}: {name}: there is no such key; allowed: {', '.join(allowed)}")
        return value

    def integer(self, value: Any, where: str, lower: int, upper: int) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not lower <= value <= upper:
            raise self.refuse(where, value, f"must be an integer; allowed: {lower} <= value <= {upper}")
        return value

    def text(self, value: Any, where: str) -> str:
        if not isinstance(value, str) or not value.strip():
            raise self.refuse(where, value, "must be a string that is not empty")
        return value

    def choice(self, value: Any, where: str, allowed: tuple[str, ...]) -> str:
        if value not in allowed:
            raise self.refuse(where, value, f"allowed: {', '.join(allowed)}")
        return str(value)

    def leaves(self, table: Any, where: str, path: str = "") -> Iterator[tuple[str, Any]]:
        """Keys with what is given for each: tables go down, but for ranges."""
        if not isinstance(table, dict) or not table:
            raise self.refuse(where, table, "must be a table of keys of the scenario")
        for key, value in table.items():
            inner = f"{path}.{key}" if path else key
            if isinstance(value, dict) and "from" not in value and "values" not in value:
                yield from self.leaves(value, where, inner)
                continue
            if key_of(inner) is None:
                near = difflib.get_close_matches(re.sub(r"\[\d+\]", "[]", inner), key_lines(), 1, 0.5)
                raise InputError(f"{self.file}: {where}.{inner} = {shown(value)[:60]}: a scenario has no such key"
                                 + (f"; nearest: {near[0]}" if near else "") + "; allowed: docs/scenario.md")
            yield inner, value

    def ends(self, value: dict[str, Any], where: str, key: str, more: tuple[str, ...]) -> tuple[float, float, bool, bool]:
        """From, to, whether the steps are those of the logarithm, whether whole numbers are asked for."""
        self.table(value, where, ("from", "to", "scale", *more))
        line = key_of(key)
        assert line is not None
        if line["type"] not in ("number", "integer") and not is_component(key):
            raise self.refuse(where, value, f"a range needs a number, {key} is of type {line['type']}; allowed: an array of values")
        whole = line["type"] == "integer"
        ends = []
        for name in ("from", "to"):
            end = value.get(name)
            if isinstance(end, bool) or not isinstance(end, (int, float)) or not np.isfinite(end):
                raise self.refuse(f"{where}.{name}", end if name in value else "", "must be a finite number")
            if whole and not isinstance(end, int):
                raise self.refuse(f"{where}.{name}", end, f"must be an integer, as {key} is")
            ends.append(end)
        is_log = self.choice(value.get("scale", "linear"), f"{where}.scale", ("linear", "log")) == "log"
        if not ends[0] < ends[1]:
            raise self.refuse(f"{where}.to", ends[1], f"allowed: over from, {shown(ends[0])}")
        if is_log and not ends[0] > 0:
            raise self.refuse(f"{where}.from", ends[0], "allowed with scale = \"log\": over 0")
        return ends[0], ends[1], is_log, whole

    def values(self, value: Any, where: str, key: str) -> list[Any]:
        """Values of a key in a grid."""
        if isinstance(value, dict):
            lower, upper, is_log, whole = self.ends(value, where, key, ("count",))
            if "count" not in value:
                if not whole:
                    raise self.refuse(where, value, "needs count")
                if upper - lower >= MOST_RUNS:
                    raise self.refuse(where, value, f"allowed: at most {MOST_RUNS} values")
                return list(range(int(lower), int(upper) + 1))
            count = self.integer(value["count"], f"{where}.count", 2, MOST_RUNS)
            steps = np.geomspace(lower, upper, count) if is_log else np.linspace(lower, upper, count)
            # Twelve digits: 0.3, not 0.30000000000000004.
            return [int(np.rint(s)) for s in steps] if whole else [float(f"{s:.12g}") for s in steps]
        if not isinstance(value, list) or not value:
            raise self.refuse(where, value, "must be an array of values, or { from, to, count, scale }")
        return value


def latin_hypercube(count: int, dimensions: int, seed: int) -> npt.NDArray[Any]:
    """(count, dimensions) in [0, 1): in every column one number in each of count equal parts."""
    random = np.random.default_rng(seed)
    strata = np.stack([random.permutation(count) for _ in range(dimensions)], axis=1)
    unit: npt.NDArray[Any] = (strata + random.random((count, dimensions))) / count
    return unit.clip(max=np.nextafter(1, 0))


def _sampled(reader: _Reader, table: dict[str, Any]) -> list[dict[str, Any]]:
    where = "latin_hypercube"
    reader.table(table, where, ("samples", "seed", "keys"))
    for name in ("samples", "keys"):
        if name not in table:
            raise InputError(f"{reader.file}: {where}.{name}: is missing")
    samples = reader.integer(table["samples"], f"{where}.samples", 1, MOST_RUNS)
    seed = reader.integer(table.get("seed", 1), f"{where}.seed", 0, 2**63 - 1)
    axes = dict(reader.leaves(table["keys"], f"{where}.keys"))
    points: list[dict[str, Any]] = [{} for _ in range(samples)]
    unit = latin_hypercube(samples, len(axes), seed)
    for column, (key, given) in enumerate(axes.items()):
        at = f"{where}.keys.{key}"
        if isinstance(given, dict) and "values" in given:
            given = reader.table(given, at, ("values",))["values"]
        if isinstance(given, list):
            choices = reader.values(given, at, key)
            for point, u in zip(points, unit[:, column]):
                point[key] = choices[int(u * len(choices))]
            continue
        if not isinstance(given, dict):
            raise reader.refuse(at, given, "must be { from, to, scale } or an array of values")
        lower, upper, is_log, whole = reader.ends(given, at, key, ())
        top = upper + 1 if whole else upper
        for point, u in zip(points, unit[:, column]):
            value = float(lower * (top / lower) ** u) if is_log else float(lower + (top - lower) * u)
            point[key] = min(int(value), int(upper)) if whole else value
    return points


def _points(reader: _Reader, content: dict[str, Any]) -> list[dict[str, Any]]:
    """Products of what list, grid and Latin hypercube give, in this order; the last one runs fastest."""
    blocks: list[list[dict[str, Any]]] = []
    if "list" in content:
        if not isinstance(content["list"], list) or not content["list"]:
            raise reader.refuse("list", content["list"], "must be an array of tables: [[list]]")
        entries = [dict(reader.leaves(entry, f"list[{i}]")) for i, entry in enumerate(content["list"])]
        for number, entry in enumerate(entries):
            if entry.keys() != entries[0].keys():
                raise InputError(f"{reader.file}: list[{number}]: has the keys {', '.join(entry)}; allowed: those of "
                                 f"list[0], {', '.join(entries[0])}")
        blocks.append(entries)
    if "grid" in content:
        axes = {key: reader.values(value, f"grid.{key}", key) for key, value in reader.leaves(content["grid"], "grid")}
        count = int(np.prod([float(len(values)) for values in axes.values()]))
        if count > MOST_RUNS:
            raise InputError(f"{reader.file}: grid: {count} points; allowed: at most {MOST_RUNS}")
        blocks.append([dict(zip(axes, values)) for values in itertools.product(*axes.values())])
    if "latin_hypercube" in content:
        blocks.append(_sampled(reader, content["latin_hypercube"]))
    if not blocks:
        raise InputError(f"{reader.file}: nothing is varied; allowed: [grid], [[list]], [latin_hypercube]")
    seen: set[str] = set()
    for block in blocks:
        if both := seen & block[0].keys():
            raise InputError(f"{reader.file}: {sorted(both)[0]}: is varied twice; allowed: in one of grid, list, latin_hypercube")
        seen |= block[0].keys()
    for key in seen:
        whole = key[: key.rindex("[")] if is_component(key) else ""
        if whole in seen:
            raise InputError(f"{reader.file}: {key}: is varied, and so is {whole}; allowed: one of them")
    count = int(np.prod([float(len(block)) for block in blocks]))
    if count > MOST_RUNS:
        raise InputError(f"{reader.file}: {count} runs; allowed: at most {MOST_RUNS}")
    return [{k: v for part in parts for k, v in part.items()} for parts in itertools.product(*blocks)]


def _set(reader: _Reader, scenario: dict[str, Any], key: str, value: Any, scenario_file: Path) -> None:
    at: Any = scenario
    parts = parts_of(key)
    for part, following in zip(parts, [*parts[1:], None]):
        if isinstance(part, int):
            if not isinstance(at, list) or part >= len(at):
                count = len(at) if isinstance(at, list) else 0
                raise InputError(f"{reader.file}: {key} = {shown(value)}: {scenario_file} has {count} of these; allowed: "
                                 f"a number below {count} between the brackets")
        elif not isinstance(at, dict):
            raise InputError(f"{reader.file}: {key} = {shown(value)}: {scenario_file} has no table there; a number in "
                             "brackets says which of several is meant")
        if following is None:
            at[part] = value
        elif isinstance(part, int):
            at = at[part]
        else:
            at = at.setdefault(part, [] if isinstance(following, int) else {})


def _files(scenario: dict[str, Any], folder: Path) -> Iterator[tuple[dict[str, Any], Path]]:
    """Tables that name a file, and the file."""
    tables = [scenario.get("organ"), *(p if isinstance(p := scenario.get("precut"), list) else [])]
    for table in tables:
        if isinstance(table, dict) and isinstance(table.get("file"), str):
            yield table, folder / table["file"]


class _Hashes:
    """Contents of the files that scenarios name, each read once."""

    def __init__(self) -> None:
        self.known: dict[Path, str] = {}

    def of(self, file: Path) -> str:
        if file not in self.known:
            self.known[file] = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "missing"
        return self.known[file]


def _plain(value: Any) -> Any:
    """With 1 for 1.0: what a scenario does not tell apart."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def identity_of(scenario: dict[str, Any], hashes: _Hashes) -> str:
    """Hash of a scenario with the contents of its files in place of their names."""
    told = copy.deepcopy(scenario)
    for table, file in _files(told, Path()):
        table["file"] = hashes.of(file)
    return hashlib.sha256(json.dumps(_plain(told), sort_keys=True).encode()).hexdigest()[:32]


def _check(study_file: Path, scenario_file: Path, keys: list[str], runs: list[Run]) -> None:
    """Every scenario as `spherecut check` reads it. Raises InputError with a line for every offence."""
    offences: dict[str, list[int]] = {}
    for number, run in enumerate(runs, 1):
        try:
            Scenario.from_text(toml_text(run.scenario), "run")
        except InputError as error:
            for line in str(error).split("\n"):
                offences.setdefault(re.sub(r"^run:\d+: |^run: ", "", line), []).append(number)
    lines = []
    for line, numbers in offences.items():
        key = line.split(" ")[0].rstrip(":")
        ours = any(key == k or re.sub(r"\[\d+\]", "", key) == re.sub(r"\[\d+\]", "", k) for k in keys)
        more = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
        lines.append(f"{study_file if ours else f'{study_file}: scenario {scenario_file}'}: {line} (run {numbers[0]:04d}{more})")
    if len(lines) > 20:
        lines = [*lines[:20], f"and {len(lines) - 20} more"]
    if lines:
        raise InputError("\n".join(lines))


def _figures(reader: _Reader, content: Any, keys: list[str]) -> list[Figure]:
    if not isinstance(content, list):
        raise reader.refuse("figure", content, "must be an array of tables: [[figure]]")
    figures = []
    for number, entry in enumerate(content):
        where = f"figure[{number}]"
        reader.table(entry, where, ("x", "y", "by", "name", "x_scale", "y_scale", "format"))
        for name in ("x", "y"):
            if name not in entry:
                raise InputError(f"{reader.file}: {where}.{name}: is missing")
        texts = {name: reader.text(entry[name], f"{where}.{name}") for name in ("x", "y", "by", "name") if name in entry}
        if not re.fullmatch(r"[\w.\[\]-]+", texts.get("name", "figure")):
            raise reader.refuse(f"{where}.name", texts["name"], "must be the name of a file, of letters, digits, _, - and .")
        scales = {n: reader.choice(entry[n], f"{where}.{n}", ("linear", "log")) for n in ("x_scale", "y_scale") if n in entry}
        kind = reader.choice(entry.get("format", "png"), f"{where}.format", ("png", "svg"))
        figure = Figure(**texts, **scales, format=kind)
        check_figure(f"{reader.file}: {where}", figure, keys)
        figures.append(figure)
    return figures


def check_figure(where: str, figure: Figure, keys: list[str]) -> None:
    """x and by are known before anything runs; what a summary has is not."""
    for name, column in (("x", figure.x), ("by", figure.by)):
        if column is None or column.startswith("summary.") or column in keys:
            continue
        if any(column == re.sub(r"\[\d+\]$", "", key) for key in keys) or any(column.startswith(key + "[") for key in keys):
            continue
        raise InputError(f"{where}.{name} = {shown(column)}: is not varied; allowed: {', '.join(keys)}, or a column summary. ...")


def read_study(file: Path) -> Study:
    """A study file with all its scenarios, checked. Raises InputError: file, key, value, limit."""
    reader = _Reader(file)
    content = read_toml(file)
    reader.table(content, "", ("title", "scenario", "grid", "list", "latin_hypercube", "figure"))
    if "scenario" not in content:
        raise InputError(f"{file}: scenario: is missing; allowed: the name of a scenario file, relative to this one")
    scenario_file = file.parent / reader.text(content["scenario"], "scenario")
    base = read_toml(scenario_file, f"{file}: scenario = {shown(content['scenario'])}: ")
    points = _points(reader, content)
    keys = list(points[0])
    hashes = _Hashes()
    runs: list[Run] = []
    known: dict[str, int] = {}
    for number, point in enumerate(points, 1):
        whole = copy.deepcopy(base)
        for key, value in sorted(point.items(), key=lambda item: is_component(item[0])):
            _set(reader, whole, key, copy.deepcopy(value), scenario_file)
        for table, named in _files(whole, scenario_file.parent):
            table["file"] = str(named.resolve())
        identity = identity_of(whole, hashes)
        if identity in known:
            told = ", ".join(f"{k} = {shown(v)}" for k, v in point.items())
            raise InputError(f"{file}: runs {known[identity]:04d} and {number:04d} are the same: {told}; allowed: every point once")
        known[identity] = number
        runs.append(Run(point, whole, identity))
    _check(file, scenario_file, keys, runs)
    title = content.get("title", "")
    if not isinstance(title, str):
        raise reader.refuse("title", title, "must be a string")
    return Study(file, title, scenario_file, keys, runs, _figures(reader, content.get("figure", []), keys))


def read_toml(file: Path, where: str = "") -> dict[str, Any]:
    """A file of TOML that a stranger may have written: none that never ends, is too long, or has no bottom."""
    try:
        if not stat.S_ISREG(file.stat().st_mode):
            raise InputError(f"{where}{file}: this is no file, but a folder, a pipe or a device")
        with file.open("rb") as stream:
            text = stream.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise InputError(f"{where}{file}: larger than {MOST_BYTES} bytes, not of a study")
        content = tomllib.loads(text.decode("utf-8"))
    except FileNotFoundError:
        raise InputError(f"{where}{file}: there is no such file") from None
    except RecursionError:
        raise _too_deep(file, where) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{where}{file}: {getattr(error, 'strerror', None) or error}") from None
    level: list[Any] = [content]
    for _ in range(MOST_LEVELS):
        within = (one.values() if isinstance(one, dict) else one for one in level if isinstance(one, (dict, list)))
        level = [child for values in within for child in values]
        if not level:
            return content
    raise _too_deep(file, where)


def _too_deep(file: Path, where: str) -> InputError:
    return InputError(f"{where}{file}: tables and arrays lie deeper than {MOST_LEVELS} in one another; allowed: {MOST_LEVELS}")
