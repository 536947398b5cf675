"""The pages as `./dev lint` looks at them (scripts/lint_docs.py), and that it sees what is wrong."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_pages import ALL

SOURCE = Path(os.environ["SPHERECUT_SOURCE"])
sys.path.insert(0, str(SOURCE / "scripts"))
import lint_docs  # noqa: E402


@pytest.mark.parametrize("page", ALL, ids=lambda page: str(page.relative_to(SOURCE)))
def test_nothing_is_found_on(page):
    assert lint_docs.findings(page) == []


def test_spelling():
    if shutil.which("codespell") is None:
        pytest.skip("codespell is not installed")
    assert lint_docs.misspelt(ALL) == []


def test_a_misspelt_word_ends_with_1(tmp_path):
    if shutil.which("codespell") is None:
        pytest.skip("codespell is not installed")
    page = tmp_path / "page.md"
    page.write_text("# Title\n\nThis is teh page.\n")
    done = subprocess.run([sys.executable, SOURCE / "scripts" / "lint_docs.py", page], capture_output=True, text=True)
    assert done.returncode == 1 and "teh" in done.stdout
    page.write_text("# Title\n\nThis is the page.\n")
    assert subprocess.run([sys.executable, SOURCE / "scripts" / "lint_docs.py", page], capture_output=True).returncode == 0


def test_a_file_that_is_not_there_ends_with_2(tmp_path):
    done = subprocess.run([sys.executable, SOURCE / "scripts" / "lint_docs.py", tmp_path / "none.md"], capture_output=True, text=True)
    assert done.returncode == 2 and "none.md is not there" in done.stderr


def test_links_that_lead_nowhere_are_found():
    page = SOURCE / "docs" / "start.md"
    text = "[a](scenario.md) [b](none.md)\n[c](scenario.md#no-such) [d](#get-it) ![e](images/none.png) [f](https://example.org/x) `[g](none.md)`"
    assert lint_docs.broken_links(page, text) == [(1, "none.md"), (2, "scenario.md#no-such"), (2, "images/none.png")]


def test_long_lines_are_found():
    long = "word " * 40
    text = f"{long}\n| {long} |\n```\n{long}\n```\n$$\n{long}\n$$\n# {long}\n- {long}\nA message `{'x' * 200}` in code.\n"
    assert [line for line, _ in lint_docs.long_lines(text)] == [1, 10]


@pytest.mark.parametrize("text, missing", [
    ("as told in [Rice 1985]", []),
    ("[Rice 1986]", ["Rice 1986"]),
    ("by Azar and Hayward 2008; Chanthasopeephan, Desai and Lau 2003", []),
    ("[Nolan and others 2014], Johnson (1985)", []),
    ("Somebody, Body and Soul 1999", ["Somebody 1999"]),
    ("measured on 27 November 2026", []),
    ("`Rice 1986`", []),
])
def test_works_without_an_entry_are_found(text, missing):
    known = lint_docs.known_works((SOURCE / lint_docs.BIBLIOGRAPHY).read_text())
    assert len(known) > 60
    assert [work for _, work in lint_docs.missing_works(text, known)] == missing


@pytest.mark.parametrize("text, found", [
    ("The version before took longer.", ["The version before"]),
    ("It no longer\nwaits; three orders were tried.", ["no longer", "were tried"]),
    ("The device that is used to press.", []),
    ("One before the other.", []),
])
def test_history_is_found(text, found):
    assert [words for _, words in lint_docs.history(text)] == found


def test_pages_that_are_not_there_are_found():
    text = "// docs/tearing.md has the rules,\n// docs/tears.md has not, and docs/experiments/none.md neither."
    assert lint_docs.missing_pages(text) == [(2, "docs/tears.md"), (2, "docs/experiments/none.md")]


def test_headers_name_pages_that_are_there():
    headers = [header for folder in ("topology", "solvers", "src", "experiments") for header in (SOURCE / folder).rglob("*.hpp")]
    assert len(headers) > 200
    assert [(header, found) for header in headers if (found := lint_docs.missing_pages(header.read_text()))] == []
