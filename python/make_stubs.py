"""Writes python/spherecut/_core.pyi from the docstrings of the built module: names, types, units.

python3 python/make_stubs.py BUILD/python          writes the file
python3 python/make_stubs.py BUILD/python --check  says whether it is as the module has it
"""

from __future__ import annotations

import inspect
import re
import sys
import textwrap
from pathlib import Path

HEADER = '''"""Types of the compiled module; python/make_stubs.py writes this file."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

'''

# As pybind11 writes a type, and as a reader of the stub wants it. Arrays of doubles that go in may be anything that numpy
# converts; whole numbers come in arrays.
ARRAY = re.compile(r"numpy\.ndarray(\[[^\]]*\])?")
PLAIN = {
    "os.PathLike": "Union[str, PathLike[str]]",
    "pathlib.Path": "Union[str, PathLike[str]]",
    "function": "Callable[..., Any]",
}


def plain_type(text: str, *, goes_in: bool) -> str:
    text = text.strip().replace("spherecut._core.", "")
    text = re.sub(r"\b(List|Tuple|Dict)\[", lambda m: m[1].lower() + "[", text)
    if goes_in:
        text = re.sub(r"\blist\[", "Sequence[", text)
    text = re.sub(r"bool\[3\]", "bool", text)
    text = ARRAY.sub(lambda m: "npt.ArrayLike" if goes_in and m[1] else "npt.NDArray[Any]", text)
    for theirs, ours in PLAIN.items():
        text = re.sub(rf"(?<![\w.]){re.escape(theirs)}\b", ours, text)
    text = re.sub(r"\bobject\b", "Any", text)
    text = re.sub(r"\bdict\b(?!\[)", "dict[str, Any]", text)
    return re.sub(r"\blist\b(?!\[)", "list[Any]", text)


def split_arguments(text: str) -> list[str]:
    """The arguments of a signature, parted at commas outside brackets."""
    parts, depth, last = [], 0, 0
    for at, letter in enumerate(text):
        depth += (letter in "([{<") - (letter in ")]}>")
        if letter == "," and depth == 0:
            parts.append(text[last:at])
            last = at + 1
    return [part.strip() for part in parts + [text[last:]] if part.strip()]


def argument(text: str) -> str:
    if text in ("*", "/") or text.startswith("*"):
        return text
    name, _, rest = text.partition(":")
    if not rest:
        return text
    kind, equals, default = rest.partition(" = ")
    kind = plain_type(kind, goes_in=True)
    if not equals:
        return f"{name}: {kind}"
    if default == "None" and not kind.startswith(("Optional", "Any")):
        kind = f"Optional[{kind}]"
    return f"{name}: {kind} = {'...' if default.startswith(('array', '<')) else default}"


def described(doc: str, indent: str) -> str:
    words = " ".join(doc.split())
    if not words:
        return f"{indent}...\n"
    lines = textwrap.wrap(words, 116 - len(indent))
    text = f'{indent}"""' + f"\n{indent}".join(lines)
    return text + ('"""\n' if len(lines) == 1 else f'\n{indent}"""\n')


def signature(name: str, doc: str, indent: str, decorator: str = "") -> str:
    first, _, rest = doc.partition("\n")
    match = re.fullmatch(rf"{re.escape(name)}\((.*)\) -> (.*)", first)
    if match is None:
        raise SystemExit(f"{name}: no signature in its docstring: {first!r}")
    arguments = [argument(part) for part in split_arguments(match[1])]
    if arguments and arguments[0].startswith("self:"):
        arguments[0] = "self"
    result = plain_type(match[2], goes_in=False)
    return f"{decorator}{indent}def {name}({', '.join(arguments)}) -> {result}:\n" + described(rest, indent + "    ")


def returned_type(getter: object) -> str:
    match = re.search(r"-> (.*)", (getter.__doc__ or "").partition("\n")[0])
    return plain_type(match[1], goes_in=False) if match else "Any"


def class_text(kind: type) -> str:
    text = f"class {kind.__name__}:\n" + described(inspect.cleandoc(kind.__doc__ or "").partition("\n\nMembers")[0], "    ")
    if hasattr(kind, "__members__"):
        text += "".join(f"    {name}: {kind.__name__}\n" for name in kind.__members__)
        return text + "    def __init__(self, value: int) -> None: ...\n    def __int__(self) -> int: ...\n"
    for name, member in vars(kind).items():
        if isinstance(member, property):
            text += f"    @property\n    def {name}(self) -> {returned_type(member.fget)}:\n"
            text += described(member.__doc__ or "", "        ")
        elif isinstance(member, staticmethod):
            text += signature(name, member.__func__.__doc__, "    ", "    @staticmethod\n")
        elif name in ("__init__", "__len__", "__call__") or not name.startswith("_"):
            doc = getattr(kind, name).__doc__ or ""
            if "->" in doc.partition("\n")[0]:
                text += signature(name, doc, "    ")
    return text


def stub_of(module: object) -> str:
    text = HEADER
    for name, member in vars(module).items():
        if name.startswith("_"):
            continue
        if inspect.isclass(member) and issubclass(member, BaseException):
            base = member.__bases__[0].__name__
            text += f"class {name}({base}):\n" + described(member.__doc__ or "", "    ") + "\n"
        elif inspect.isclass(member):
            text += class_text(member) + "\n"
        else:
            text += signature(name, member.__doc__, "") + "\n"
    return text + "__version__: str\n"


def main() -> int:
    sys.path.insert(0, sys.argv[1])
    from spherecut import _core

    target = Path(__file__).parent / "spherecut" / "_core.pyi"
    text = stub_of(_core)
    if "--check" not in sys.argv:
        target.write_text(text)
        return 0
    if target.read_text() == text:
        return 0
    print(f"{target} is not as the module has it; python3 python/make_stubs.py {sys.argv[1]} writes it anew")
    return 1


if __name__ == "__main__":
    sys.exit(main())
