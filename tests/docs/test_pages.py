"""Pages and their places on the site, and the code that the tutorials quote: what needs no Sphinx."""

import os
import re
import sys
from pathlib import Path

import pytest
from commands import pages

SOURCE = Path(os.environ["SPHERECUT_SOURCE"])
sys.path.insert(0, str(SOURCE / "docs" / "site"))
import build  # noqa: E402

ALL = pages(SOURCE) + [SOURCE / "CHANGELOG.md", SOURCE / "SECURITY.md"]


def test_every_example_has_a_tutorial():
    scripts = {file.stem for file in (SOURCE / "examples" / "python").glob("*.py")}
    tutorials = {file.stem for file in (SOURCE / "docs" / "tutorials").glob("*.md")} - {"README"}
    assert scripts == tutorials
    listed = (SOURCE / "docs" / "tutorials" / "README.md").read_text()
    assert all(f"({name}.md)" in listed for name in tutorials)


@pytest.mark.parametrize("page", sorted((SOURCE / "docs" / "tutorials").glob("[a-z]*.md")), ids=lambda page: page.stem)
def test_tutorials_quote_their_scripts(page):
    script = SOURCE / "examples" / "python" / f"{page.stem}.py"
    text = page.read_text()
    assert text.count("```python") >= 2
    build.check_quotes(page.stem, text, script)
    with pytest.raises(SystemExit):
        build.check_quotes(page.stem, text + "```python\nsc.does_not_exist()\n```\n", script)


def test_extending_quotes_the_sources():
    page = (SOURCE / "docs" / "extending.md").read_text()
    blocks = re.findall(r"^In `([\w/.]+)`:\n\n```cpp\n(.*?)^```", page, re.S | re.M)
    assert len(blocks) == page.count("```cpp") > 10
    for file, block in blocks:
        assert block in (SOURCE / file).read_text(), f"docs/extending.md: {file} does not have\n{block}"
    assert all((SOURCE / name).exists() for name in re.findall(r"`((?:topology|solvers|src|experiments|tests|python)/[\w/.]+)`", page))


def test_every_page_has_its_place_on_the_site(tmp_path):
    """Pages come by pattern: one that no section names is a how-to page."""
    listed = {str(page.relative_to(SOURCE).with_suffix("")) for page in ALL}
    assert set(build.pages()) == listed
    named = {name for names in build.SECTIONS.values() for name in names if not name.startswith("reference/")}
    assert named <= listed


def test_versions_agree():
    """Of CMake, the Python package, CITATION.cff, BibTeX in README, what the pages tell to find, and the changelog."""
    version = re.search(r"project\(spherecut VERSION ([\d.]+)", (SOURCE / "CMakeLists.txt").read_text())[1]
    minor = version.rsplit(".", 1)[0]
    for file, pattern in {"pyproject.toml": r'^version = "([\d.]+)"', "CITATION.cff": r"^version: ([\d.]+)", "README.md": r"^  version = \{([\d.]+)\}",
                          "CHANGELOG.md": r"^## ([\d.]+)"}.items():
        assert re.search(pattern, (SOURCE / file).read_text(), re.M)[1] == version, file
    for file in ("docs/library.md", "examples/libraries/CMakeLists.txt"):
        assert re.search(r"find_package\(spherecut ([\d.]+) ", (SOURCE / file).read_text())[1] == minor, file
    assert f"minor version, {minor}," in (SOURCE / "SECURITY.md").read_text()


def test_public_headers():
    found = build.headers()
    assert "solvers/body/discretisation.hpp" in found and len(found) > 40
    assert all((SOURCE / header).is_file() and len(build.what_for(header)) > 10 for header in found)
