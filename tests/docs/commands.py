"""The commands of the documentation: where they stand, and how each is tried."""

import re
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

# What a command begins with, after variables that are set for it.
PROGRAMS = r"spherecut|build/release/[\w/]+|\./dev|cmake|ctest|ninja|pip|python3|sudo|tests/page/run\.sh|scripts/[\w.]+|\.ci/run"
BEGINS = re.compile(rf"(?:[A-Z_]+=\S+ )*(?:{PROGRAMS})(?:\s|$)")


@dataclass(frozen=True)
class Command:
    page: str  # relative to the repository
    line: int
    text: str  # without its comment

    def __str__(self) -> str:
        return f"{self.page}:{self.line}: {self.text}"


@dataclass(frozen=True)
class Written:
    """A file that a page tells the reader to write."""

    page: str
    line: int
    name: str
    text: str


def pages(source: Path) -> list[Path]:
    found = [source / "README.md", source / "CONTRIBUTING.md", source / "examples" / "README.md"]
    for folder in ["docs", "docs/tutorials", "docs/experiments"]:
        found += sorted((source / folder).glob("*.md"))
    return found


def without_comment(line: str) -> str:
    """A comment begins at a # after a blank, outside of quotes."""
    quote = ""
    for k, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        elif letter == "#" and (k == 0 or line[k - 1] in " \t"):
            return line[:k].strip()
    return line.strip()


def complete(text: str) -> bool:
    return not text.endswith("\\") and subprocess.run(["bash", "-n"], input=text, capture_output=True, text=True).returncode == 0


def commands_of(source: Path, page: Path) -> list[Command | Written]:
    """In the order of the page: commands of fenced blocks, of indented blocks and of code within the text; files to write."""
    name = str(page.relative_to(source))
    found: list[Command | Written] = []
    fence: str | None = None
    language, to_write, waiting, first = "", "", "", 0
    for number, line in enumerate(page.read_text().splitlines(), 1):
        opening = re.match(r"^(```+)(\w*)", line)
        if fence is None and opening:
            fence, language, first = opening[1], opening[2], number + 1
            body: list[str] = []
            continue
        if fence is not None:
            if line.startswith(fence):
                if language == "toml" and to_write:
                    found.append(Written(name, first, to_write, "\n".join(body) + "\n"))
                    to_write = ""
                if waiting:
                    raise AssertionError(f"{name}:{first}: this is no complete command: {waiting}")
                fence = None
                continue
            body.append(line)
            shell = language in ("sh", "bash", "console", "shell")
            if shell or (language == "" and (waiting or BEGINS.match(line) or line.startswith("{ "))):
                text = f"{waiting}\n{without_comment(line)}".strip()
                first = first if waiting else number
                if text and not complete(text):
                    waiting = text
                    continue
                waiting = ""
                if text:
                    found.append(Command(name, first, text))
            continue
        into = re.search(r"into `([\w.]+\.toml)`", line)
        if into:
            to_write = into[1]
        if re.match(r"^    \S", line) and BEGINS.match(line.strip()):
            found.append(Command(name, number, without_comment(line)))
            continue
        for span in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", line):
            if BEGINS.match(span) and " " in span:
                found.append(Command(name, number, span.strip()))
    return found


def words(text: str) -> list[str]:
    """Of a command; brackets mark what may be left out, and it is looked at too."""
    return shlex.split(re.sub(r"[\[\]]|\.\.\.", " ", text))
