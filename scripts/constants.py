#!/usr/bin/env python3
"""Lists the named numbers of the sources, file by file: name, value, and the comment that says what it is."""
import pathlib
import re
import signal

ROOT = pathlib.Path(__file__).resolve().parent.parent
DECLARED = re.compile(r"^\s*(?:inline |static )?constexpr (?:double|int|float|std::size_t) (?P<rest>[a-z_]+ = .*)$")
NUMBER = re.compile(r"(?P<name>[a-z_]+) = (?P<value>[^,;]+)")


def numbers(path):
    """(line, name, value, meaning) of every named number in a file."""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        declared = DECLARED.match(line)
        if not declared:
            continue
        code, _, meaning = declared["rest"].partition("//")
        for found in NUMBER.finditer(code):
            yield number, found["name"], found["value"].strip(), meaning.strip()


def main():
    for floor in ("topology", "solvers", "src"):
        for path in sorted((ROOT / floor).rglob("*.[ch]pp")):
            for line, name, value, meaning in numbers(path):
                print(f"{path.relative_to(ROOT)}:{line}: {name} = {value}" + (f"  // {meaning}" if meaning else ""))


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # a reader may have seen enough
    main()
