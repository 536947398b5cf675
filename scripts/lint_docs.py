#!/usr/bin/env python3
"""Looks at the pages (*.md) and the headers: lint_docs.py [FILE...]; without files at all that git knows.

Pages: links to files and headings of the repository lead somewhere; lines of prose have at most 160 letters; a work that is cited
with its year stands in the bibliography of docs/references.md; nothing tells what earlier versions did (docs/decisions.md and the
changelog may). Headers: pages that they name are there. Pages and headers: spelling, by codespell. One line for each finding; exits
1 where there is one, 2 where a file is not there or codespell is not installed.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BIBLIOGRAPHY = "docs/references.md"
LONGEST = 160  # letters of a line of prose; tables, code, pictures and entries of the bibliography may be longer
WRITTEN = "This part is written by"  # what follows on a page comes from a program
MAY_TELL_HISTORY = {"docs/decisions.md", "CHANGELOG.md"}
# What a page says that tells how something came about.
HISTORY = re.compile(r"\b(used to (?:be|take|have|do|give)|no longer|earlier (?:version|run)s?|(?:the )?version before|since then|until then|(?:was|were) tried|"
                     r"formerly|previously|at that time|as it once was|once (?:took|suffered|was|were)|in place of the old)\b", re.I)
MONTHS = "January February March April May June July August September October November December".split()
NAME = r"[A-Z][^\W\d_]+(?:-[A-Z][^\W\d_]+)*"
CITATION = re.compile(rf"\b({NAME})(?:(?:, {NAME})*,? and (?:{NAME}|others))?,? \[?((?:18|19|20)\d\d)\b")
CODE = re.compile(r"^```.*?^```|(?<!\[)`[^`\n]+`|\$\$.*?\$\$", re.S | re.M)
# Words that are right here though codespell does not know them.
WORDS = "fro,mouvement,yau"


def blanked(text: str) -> str:
    """The text without code and formulas, with its lines where they were."""
    return CODE.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def line_of(text: str, place: int) -> int:
    return text.count("\n", 0, place) + 1


# --- links


def anchors(page: Path) -> set[str]:
    """As GitHub makes them of the headings."""
    found: set[str] = set()
    for heading in re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", page.read_text(), flags=re.S | re.M), re.M):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
        found.add(re.sub(r"[^\w\- ]", "", plain).replace(" ", "-"))
    return found


def broken_links(page: Path, text: str) -> list[tuple[int, str]]:
    """Line and target of every link that leads nowhere."""
    prose = blanked(text)
    broken = []
    for found in re.finditer(r"!?\[[^\]]*\]\(([^)\s]+)\)", prose):
        target = found[1]
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and (file.suffix != ".md" or anchor not in anchors(file))):
            broken.append((line_of(text, found.start()), target))
    return broken


# --- words


def long_lines(text: str) -> list[tuple[int, int]]:
    """Line and length of every line of prose that is too long. Tables, headings, pictures, code and formulas are not broken."""
    found = []
    fence = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith(("```", "$$")):
            fence = not fence
            continue
        if fence or line.startswith(("|", "#", "![", "*![", "    ")):
            continue
        length = len(re.sub(r"`[^`]{100,}`", "", line))  # a message in code stays in one piece
        if length > LONGEST:
            found.append((number, length))
    return found


def known_works(bibliography: str) -> set[tuple[str, str]]:
    """Every author of an entry with its year: '- A. Author, B. Other 1957: ...'."""
    known = set()
    for entry, year in re.findall(r"^- ([^:\n]+?) ((?:18|19|20)\d\d):", bibliography, re.M):
        known |= {(name.split()[-1], year) for name in entry.split(", ")}
    return known


def missing_works(text: str, known: set[tuple[str, str]]) -> list[tuple[int, str]]:
    """Line and name of every citation without an entry."""
    prose = blanked(text)
    return [(line_of(text, found.start()), f"{found[1]} {found[2]}") for found in CITATION.finditer(prose)
            if found[1] not in MONTHS and (found[1], found[2]) not in known]


def history(text: str) -> list[tuple[int, str]]:
    """Line and words of what tells of earlier versions."""
    prose = blanked(text)
    return [(line_of(text, found.start()), found[0]) for found in HISTORY.finditer(prose)]


def misspelt(files: list[Path]) -> list[str]:
    """What codespell says, a line each."""
    done = subprocess.run(["codespell", "--ignore-words-list", WORDS, *map(str, files)], capture_output=True, text=True, cwd=ROOT)
    return done.stdout.splitlines()


def missing_pages(text: str) -> list[tuple[int, str]]:
    """Line and name of every page that a header names and that is not there."""
    return [(line_of(text, found.start()), found[0]) for found in re.finditer(r"\bdocs/[\w/]+\.md\b", text) if not (ROOT / found[0]).is_file()]


def name_of(file: Path) -> str:
    return str(file.resolve().relative_to(ROOT)) if file.resolve().is_relative_to(ROOT) else str(file)


def findings(page: Path) -> list[str]:
    """Of one page, without spelling."""
    text, name = page.read_text(), name_of(page)
    known = known_works((ROOT / BIBLIOGRAPHY).read_text())
    said = [f"{name}:{line}: the link '{target}' leads nowhere" for line, target in broken_links(page, text)]
    if name != BIBLIOGRAPHY:
        said += [f"{name}:{line}: {length} letters, at most {LONGEST}" for line, length in long_lines(text.partition(WRITTEN)[0])]
    cites = text.partition("\n## Bibliography")[0] if name == BIBLIOGRAPHY else text
    said += [f"{name}:{line}: '{work}' has no entry in {BIBLIOGRAPHY}" for line, work in missing_works(cites, known)]
    if name not in MAY_TELL_HISTORY:
        said += [f"{name}:{line}: '{words}' tells of the past; docs/decisions.md may" for line, words in history(text)]
    return said


def tracked(*patterns: str) -> list[Path]:
    """Files that git knows, but for the site's own page, whose links are those of the site."""
    done = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", *patterns, ":!docs/site"], cwd=ROOT, capture_output=True,
                          text=True, check=True)
    return [ROOT / name for name in done.stdout.splitlines() if (ROOT / name).is_file()]


def main(arguments: list[str]) -> int:
    files = [Path(name) for name in arguments] or tracked("*.md", "*.hpp")
    for file in files:
        if not file.is_file():
            print(f"lint_docs.py: {file} is not there", file=sys.stderr)
            return 2
    if shutil.which("codespell") is None:
        print("lint_docs.py: codespell is not installed (cmake/debian-packages-tests.txt)", file=sys.stderr)
        return 2
    said = [line for page in files if page.suffix == ".md" for line in findings(page)]
    said += [f"{name_of(file)}:{line}: there is no {page}" for file in files if file.suffix != ".md" for line, page in missing_pages(file.read_text())]
    said += misspelt(files)
    print("\n".join(said) if said else f"lint: {len(files)} pages and headers spelt, linked and cited")
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
