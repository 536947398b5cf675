#!/usr/bin/env python3
"""Lists functions of the headers that no source but their own calls: dead ones, and those that tests alone call.

Works on names: a name counts as called where it stands in a source or header other than in its declarations and
definitions. Functions that share a name with another are therefore missed, never accused. Programs, experiments, the Python
package and the examples count as callers.

usage: scripts/unused_functions.py [--only-dead]
Ends with 1 where a function is called by nobody, tests included."""

import re
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FLOORS = ("topology", "solvers", "src")
CALLERS = (*FLOORS, "experiments", "apps", "python", "examples")
NOT_FUNCTIONS = set("if for while switch return sizeof static_assert decltype alignas operator defined noexcept catch explicit".split())
CALLED_BY_THE_LIBRARY = {"allocate", "deallocate"}  # of an allocator
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"')
# A declaration: a type, a name, an opening bracket, at the beginning of a statement.
DECLARED = re.compile(
    r"(?:^|[;{}]|\bpublic:|\bprotected:|\bprivate:|>|\]\])\s*(?:\[\[nodiscard\]\]\s*)?(?:(?:virtual|static|constexpr|inline|friend|explicit|extern)\s+)*"
    r"(?:[\w:<>,\s*&]|\bconst\b)*?[\w>&*]\s+[*&]*(~?\w+)\s*\(", re.M)


def text_of(file: Path) -> str:
    return STRING.sub('""', COMMENT.sub("", file.read_text(encoding="utf-8", errors="replace")))


def sources(*folders: str) -> list[Path]:
    found = (file for folder in folders for ending in ("hpp", "cpp", "inl", "h") for file in (ROOT / folder).rglob(f"*.{ending}"))
    return sorted(file for file in found if "node_modules" not in file.parts)


def declarations(text: str) -> list[str]:
    """The name of every declaration and definition in the text, as often as it stands there."""
    return [found[1] for found in DECLARED.finditer(text) if not re.search(r"\b(?:return|else|throw|new|case|requires)\b", found[0])]


def declared_names(text: str) -> set[str]:
    return {name for name in declarations(text) if name not in NOT_FUNCTIONS and not name.startswith("~")}


def calls_of(texts: list[str]) -> dict[str, int]:
    """How often each name stands before a bracket or is handed on, declarations and definitions left out."""
    count: dict[str, int] = defaultdict(int)
    for text in texts:
        for name in re.findall(r"\b\w+\b", text):
            count[name] += 1
        for name in declarations(text):
            count[name] -= 1
        for name in re.findall(r"^(?=\S)[\w:<>,*&\s]*?\b(?:\w+(?:<[^<>]*>)?::)+(~?\w+)\s*\([^;]*?\)[^;{}]*\{", text, re.M):
            count[name] -= 1 if DECLARED.search(name) is None else 0
    return count


def unused(headers: dict[str, str], callers: list[str], tests: list[str]) -> tuple[list[str], list[str]]:
    """Of the functions that the headers declare: those that nobody calls, and those that tests alone call."""
    used, tested = calls_of(callers), calls_of(tests)
    dead, only_tests = [], []
    for header, text in headers.items():
        for name in sorted(declared_names(text)):
            if used[name] <= 0 and name not in CALLED_BY_THE_LIBRARY:
                (only_tests if tested[name] > 0 else dead).append(f"{header}: {name}")
    return dead, only_tests


def main() -> int:
    headers = {str(file.relative_to(ROOT)): text_of(file) for file in sources(*FLOORS) if file.suffix == ".hpp"}
    dead, only_tests = unused(headers, [text_of(file) for file in sources(*CALLERS)], [text_of(file) for file in sources("tests")])
    for title, names in (("called by nobody", dead), ("called by tests alone", only_tests)):
        if title == "called by nobody" or "--only-dead" not in sys.argv:
            print(f"{len(names)} functions {title}")
            print("".join(f"  {name}\n" for name in names), end="")
    return 1 if dead else 0


if __name__ == "__main__":
    sys.exit(main())
