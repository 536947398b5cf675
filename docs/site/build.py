#!/usr/bin/env python3
"""Builds the site of the documentation: build.py --build BUILD_TREE --out FOLDER [--pages-only]

BUILD_TREE has the Python package, whose examples the tutorials run. Pages are staged in FOLDER/source in the places that they have
in the repository, so that links among them are the same here and there; the site is FOLDER/html. Files and folders of the
repository that pages link to become pages that show them. --pages-only leaves out the examples and the C++ reference.
Exits 1 where Sphinx or Doxygen has a warning, or a tutorial quotes what its script does not have.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path
from urllib.parse import unquote

SITE = Path(__file__).resolve().parent
ROOT = SITE.parent.parent
FLOORS = ["topology", "solvers", "src"]
# Which pages of docs/ go where; those that are not named here are how-to pages.
SECTIONS = {
    "Start here": ["docs/start", "README", "docs/faq"],
    "Tutorials": ["docs/tutorials/README", "examples/README"],
    "How-to": [],
    "Reference": ["docs/scenario", "docs/output", "reference/cpp", "reference/python", "docs/viewer_protocol", "docs/glossary"],
    "Theory": ["docs/theory", "docs/architecture", "docs/haptics_design", "docs/references"],
    "Experiments": ["docs/experiments/README", "docs/performance", "docs/remeshing_ledger", "docs/remeshing_ledger_runs", "docs/cutbench"],
    "The project": ["CONTRIBUTING", "docs/decisions", "SECURITY", "CHANGELOG"],
}
LINK = re.compile(r"(?<!!)(\[[^\]]*\])\(([^)\s]+)\)")
HIGHLIGHT = {".py": "python", ".pyi": "python", ".cpp": "cpp", ".hpp": "cpp", ".toml": "toml", ".sh": "bash", ".json": "json",
             ".cmake": "cmake", ".ts": "typescript"}


def fail(message: str) -> None:
    sys.exit(f"docs/site/build.py: {message}")


def pages() -> list[str]:
    """Every Markdown page of the site, without extension, relative to the repository."""
    found = [ROOT / name for name in ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "examples/README.md"]]
    for folder in ["docs", "docs/tutorials", "docs/experiments"]:
        found += sorted((ROOT / folder).glob("*.md"))
    return [str(page.relative_to(ROOT).with_suffix("")) for page in found]


class Staging:
    """The folder that Sphinx reads."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.written: set[Path] = set()
        self.shown: dict[Path, None] = {}  # files and folders of the repository that pages link to, in order

    def write(self, name: str, text: str) -> None:
        """Only what has changed, so that Sphinx reads only that again."""
        file = self.folder / name
        self.written.add(file)
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists() or file.read_text() != text:
            file.write_text(text)

    def copy(self, source: Path, name: str) -> None:
        file = self.folder / name
        self.written.add(file)
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists() or file.read_bytes() != source.read_bytes():
            shutil.copy(source, file)

    def remove_others(self) -> None:
        for file in self.folder.rglob("*"):
            if file.is_file() and file not in self.written:
                file.unlink()

    def redirect(self, page: Path, text: str, known: set[str]) -> str:
        """Links that lead out of the pages go to pages that show what is there. `page`: where the text is."""

        def link(match: re.Match[str]) -> str:
            label, target = match.groups()
            if re.match(r"[a-z]+:|#", target):
                return match.group(0)
            path, _, anchor = target.partition("#")
            absolute = (page.parent / path).resolve()
            if not absolute.is_relative_to(ROOT):
                fail(f"{page.relative_to(ROOT)}: the link '{target}' leads out of the repository")
            if not absolute.exists():
                fail(f"{page.relative_to(ROOT)}: the link '{target}' leads nowhere")
            inside = absolute.relative_to(ROOT)
            if absolute.is_dir():
                if (absolute / "README.md").exists() and str(inside / "README") in known:
                    return f"{label}(/{inside}/README.md)"
                self.shown[inside] = None
                return f"{label}(/files/{inside}/index.md)"
            if absolute.suffix == ".md" and str(inside.with_suffix("")) in known:
                return match.group(0)
            self.shown[inside] = None
            return f"{label}(/files/{inside}.md)"

        parts = re.split(r"(^```.*?^```[^\n]*$|(?<!\[)`[^`\n]+`)", text, flags=re.S | re.M)  # not in code
        return "".join(part if i % 2 else LINK.sub(link, part) for i, part in enumerate(parts))

    def show_files(self) -> list[str]:
        """Pages of the files and folders that are linked to."""
        made = []
        waiting = list(self.shown)
        seen = set()
        while waiting:
            inside = waiting.pop(0)
            if inside in seen:
                continue
            seen.add(inside)
            path = ROOT / inside
            if path.is_dir():
                entries = sorted(entry for entry in path.iterdir() if entry.name != "__pycache__")
                lines = [f"- [{entry.name}](/files/{inside}/{entry.name}{'/index' if entry.is_dir() else ''}.md)" for entry in entries]
                waiting += [entry.relative_to(ROOT) for entry in entries]
                name = f"files/{inside}/index"
                self.write(f"{name}.md", f"---\norphan: true\n---\n# {inside}/\n\n" + "\n".join(lines) + "\n")
            else:
                language = HIGHLIGHT.get(path.suffix, "cmake" if path.name == "CMakeLists.txt" else "text")
                self.copy(path, f"files/{inside}.source")
                name = f"files/{inside}"
                self.write(f"{name}.md", f"---\norphan: true\n---\n# {inside}\n\n"
                           f"```{{literalinclude}} {path.name}.source\n:language: {language}\n```\n")
            made.append(name)
        return made


# --- tutorials


def run_example(script: Path, build: Path, cache: Path) -> tuple[str, Path]:
    """What the script prints, and its picture. Kept until the script, the package or the module changes."""
    package = build / "python" / "spherecut"
    digest = hashlib.sha256(script.read_bytes())
    for file in sorted(package.iterdir()):
        if file.suffix in (".py", ".so"):
            digest.update(file.read_bytes())
    folder = cache / script.stem
    mark, said, picture = folder / "digest", folder / "said.txt", folder / f"{script.stem}.png"
    if not (mark.exists() and mark.read_text() == digest.hexdigest() and said.exists() and picture.exists()):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        print(f"  running {script.relative_to(ROOT)}", flush=True)
        environment = os.environ | {"PYTHONPATH": str(package.parent), "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run([sys.executable, str(script), "--out", str(folder)], env=environment, capture_output=True, text=True)
        if done.returncode != 0 or not picture.exists():
            fail(f"{script.relative_to(ROOT)} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
        said.write_text(done.stdout)
        mark.write_text(digest.hexdigest())
    return said.read_text(), picture


def check_quotes(name: str, text: str, script: Path) -> None:
    """The code on a tutorial's page is that of its script, in its order."""
    code, place = script.read_text(), 0
    for block in re.findall(r"^```(?:python|toml)\n(.*?)^```", text, re.S | re.M):
        found = code.find(block, place)
        if found < 0:
            fail(f"docs/tutorials/{name}.md: this is not in {script.relative_to(ROOT)}, or not there:\n{block}")
        place = found + len(block)


def tutorial(name: str, text: str, staging: Staging, build: Path, cache: Path, run: bool) -> str:
    script = ROOT / "examples" / "python" / f"{name}.py"
    check_quotes(name, text, script)
    if run:
        said, picture = run_example(script, build, cache)
        staging.copy(picture, f"docs/tutorials/{name}.png")
        text += f"\n## What it prints\n\n```text\n{said}```\n\n## Its picture\n\n![What the script draws]({name}.png)\n"
    staging.copy(script, f"docs/tutorials/{name}.source")
    return text + f"\n## The whole script\n\n```{{literalinclude}} {name}.source\n:language: python\n```\n"


# --- reference of the Python package, by autodoc

# Modules of the package: name, title, what it is for.
MODULES = {
    "spherecut": "Floors, sessions and runs",
    "spherecut.env": "Environment",
    "spherecut.sweep": "Studies",
}
# All names of a staged module are told as those of the module that a user imports.
AS_IMPORTED = """
for _value in list(globals().values()):
    if getattr(_value, "__module__", "").startswith("spherecut._"):
        _value.__module__ = "spherecut"
"""


def stage_package(out: Path, version: str) -> None:
    """The package as autodoc imports it: the compiled module is its stub file, which has types and docstrings."""
    package, target = ROOT / "python" / "spherecut", out / "package" / "spherecut"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(package, target, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    stub = target / "_core.pyi"
    stub.rename(target / "_core.py")
    (target / "_core.py").write_text("from __future__ import annotations\n" + (target / "_core.py").read_text()
                                     + f'\n__version__ = "{version}"\n')
    with (target / "__init__.py").open("a") as file:
        file.write(AS_IMPORTED)


def python_reference() -> str:
    title = "Python reference"
    text = (f"{title}\n{'=' * len(title)}\n\nThe package ``spherecut``: every name with its types. "
            "A worked example and what holds everywhere are on :doc:`the page of the package </docs/python>`.\n\n")
    for module, what in MODULES.items():
        text += f"{what}\n{'-' * len(what)}\n\n.. automodule:: {module}\n   :members:\n   :undoc-members:\n\n"
    return text


# --- reference of the C++ headers


def headers() -> list[str]:
    """The public headers: those that docs/library.md names under "Where to begin", and all that they include."""
    named = re.findall(r"`((?:topology|solvers|src)/[\w/]+\.hpp)`", (ROOT / "docs" / "library.md").read_text())
    if len(named) < 20:
        fail("docs/library.md names fewer than 20 headers")
    found: dict[str, None] = {}
    while named:
        header = named.pop(0)
        if header in found:
            continue
        if not (ROOT / header).exists():
            fail(f"docs/library.md names {header}, which is not there")
        found[header] = None
        named += re.findall(r'^#include "((?:topology|solvers|src)/[^"]+)"', (ROOT / header).read_text(), re.M)
    return sorted(found, key=lambda header: (FLOORS.index(header.split("/")[0]), header))


def what_for(header: str) -> str:
    """The comment that a header begins with."""
    lines = []
    for line in (ROOT / header).read_text().splitlines():
        if not line.startswith("//"):
            break
        lines.append(line[2:].removeprefix(" "))
    return "\n".join(lines).split("\n\n")[0].replace("\n", " ").split(". ")[0].rstrip(".:") + "."


def doxygen(out: Path, used: list[str]) -> None:
    folder = out / "doxygen"
    folder.mkdir(parents=True, exist_ok=True)
    settings = {
        "PROJECT_NAME": "Spherecut", "OUTPUT_DIRECTORY": folder, "GENERATE_HTML": "NO", "GENERATE_LATEX": "NO", "GENERATE_XML": "YES",
        "XML_PROGRAMLISTING": "NO", "INPUT": " ".join(str(ROOT / header) for header in used), "FULL_PATH_NAMES": "YES",
        "STRIP_FROM_PATH": ROOT, "QUIET": "YES", "WARNINGS": "YES", "WARN_IF_UNDOCUMENTED": "NO", "WARN_NO_PARAMDOC": "NO", "WARN_AS_ERROR": "FAIL_ON_WARNINGS",
        "EXTRACT_ALL": "YES", "EXTRACT_PRIVATE": "NO", "INPUT_FILTER": f'"{sys.executable} {SITE / "doxygen_filter.py"}"', "MARKDOWN_SUPPORT": "NO",
        "AUTOLINK_SUPPORT": "NO", "ENABLE_PREPROCESSING": "YES", "MACRO_EXPANSION": "NO", "JAVADOC_AUTOBRIEF": "NO", "SORT_MEMBER_DOCS": "NO",
        "WARN_FORMAT": '"$file:$line: $text"',
    }
    (folder / "Doxyfile").write_text("".join(f"{key} = {value}\n" for key, value in settings.items()))
    done = subprocess.run(["doxygen", str(folder / "Doxyfile")], capture_output=True, text=True)
    if done.returncode != 0:
        fail(f"Doxygen has something to say:\n{done.stdout}{done.stderr}")
    for file in (folder / "xml").glob("*.xml"):  # Doxygen leaves the slashes of the comment in what is verbatim
        text = file.read_text()
        plain = re.sub(r"(?<=<verbatim>).*?(?=</verbatim>)", lambda found: re.sub(r"^ *///? ?", "", found[0], flags=re.M), text, flags=re.S)
        if plain != text:
            file.write_text(plain)
    for header in used:
        name = header.rsplit("/", 1)[1][:-4]
        if "<inner" not in (folder / "xml" / f"{name.replace('_', '__')}_8hpp.xml").read_text():
            fail(f"Doxygen has found nothing in {header}")


def cpp_reference(staging: Staging, used: list[str]) -> None:
    title = "C++ reference"
    text = (f"{title}\n{'=' * len(title)}\n\nThe public headers: those that :doc:`/docs/library` names, and what they include. A program includes them as "
            "``<spherecut/FLOOR/NAME.hpp>``.\n\n")
    for floor in FLOORS:
        own = [header for header in used if header.startswith(floor + "/")]
        text += f"{floor}\n{'-' * len(floor)}\n\n.. toctree::\n   :hidden:\n\n" + "".join(f"   /reference/cpp/{h[:-4]}\n" for h in own) + "\n"
        text += ".. list-table::\n   :widths: 30 70\n\n"
        for header in own:
            name = f"/reference/cpp/{header[:-4]}"
            text += f"   * - :doc:`{header.split('/', 1)[1]} <{name}>`\n     - {what_for(header).replace('*', chr(92) + '*').replace('_', chr(92) + '_')}\n"
            staging.write(f"{name[1:]}.rst", f"{header}\n{'=' * len(header)}\n\n.. code-block:: cpp\n\n   #include <spherecut/{header}>\n\n"
                          f".. doxygenfile:: {header}\n   :project: spherecut\n")
        text += "\n"
    staging.write("reference/cpp.rst", text)


# --- the whole


def stage(out: Path, build: Path, pages_only: bool) -> Staging:
    staging = Staging(out / "source")
    known = set(pages())
    placed = {name for names in SECTIONS.values() for name in names}
    how_to = [name for name in sorted(known) if re.fullmatch(r"docs/\w+", name) and name not in placed]
    for name in sorted(known):
        file = ROOT / f"{name}.md"
        text = file.read_text()
        if name == "README":
            text = text.replace("# Spherecut\n", "# What Spherecut does\n", 1)
        text = staging.redirect(file, text, known)
        if name.startswith("docs/tutorials/") and not name.endswith("README"):
            text = tutorial(file.stem, text, staging, build, out / "examples", not pages_only)
        for listing in ("docs/tutorials", "docs/experiments"):
            if name == f"{listing}/README":
                own = [other for other in sorted(known) if other.startswith(listing + "/") and not other.endswith("README")]
                text += "\n```{toctree}\n:hidden:\n\n" + "".join(f"/{other}\n" for other in own) + "```\n"
        staging.write(f"{name}.md", text)
    for image in sorted((ROOT / "docs" / "images").iterdir()):
        staging.copy(image, f"docs/images/{image.name}")
    staging.show_files()
    staging.write("reference/python.rst", python_reference())
    if not pages_only:
        used = headers()
        doxygen(out, used)
        cpp_reference(staging, used)
    index = (SITE / "index.md").read_text()
    for section, names in SECTIONS.items():
        names = how_to if section == "How-to" else names
        names = [name for name in names if not (pages_only and name == "reference/cpp")]
        index += f"\n```{{toctree}}\n:hidden:\n:caption: {section}\n\n" + "".join(f"/{name}\n" for name in names) + "```\n"
    staging.write("index.md", index)
    staging.copy(SITE / "conf.py", "conf.py")
    staging.copy(SITE / "site.css", "_static/site.css")
    staging.remove_others()
    return staging


def remove_old(source: Path, html: Path) -> None:
    """Pages of the site whose sources are no more."""
    for page in html.rglob("*.html"):
        inside = page.relative_to(html).with_suffix("")
        made_by_sphinx = str(inside) in ("genindex", "search", "py-modindex") or inside.parts[0] == "_static"
        if not made_by_sphinx and not any((source / f"{inside}{suffix}").exists() for suffix in (".md", ".rst")):
            page.unlink()


def copy_mathjax(html: Path) -> None:
    """What of Debian's MathJax the pages load: they need no network."""
    source, target = Path("/usr/share/javascript/mathjax"), html / "_static" / "mathjax"
    for name in ["MathJax.js", "config/TeX-AMS_SVG-full.js", "extensions", "jax/element", "jax/input/TeX", "jax/output/SVG/jax.js",
                 "jax/output/SVG/config.js", "jax/output/SVG/autoload", "jax/output/SVG/fonts/TeX"]:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, dirs_exist_ok=True)
        else:
            shutil.copy(source / name, target / name)


def check_links(html: Path) -> int:
    """Every link within the site leads to a file of it, and to a place in that file; nothing is loaded from elsewhere. Returns
    how many links there are."""
    places: dict[Path, set[str]] = {}

    def names(file: Path) -> set[str]:
        if file not in places:
            places[file] = set(re.findall(r'\b(?:id|name)="([^"]+)"', file.read_text()))
        return places[file]

    count, broken = 0, []
    for page in sorted(html.rglob("*.html")):
        for tag in re.findall(r'<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)="(?:https?:)?//[^>]*>', page.read_text()):
            broken.append(f"{page.relative_to(html)}: needs the network: {tag}")
        for target in set(re.findall(r'\b(?:href|src)="([^"]+)"', page.read_text())):
            target = unquote(unescape(target))
            if re.match(r"[a-z]+:", target) or (target.startswith("#") and not target[1:]):
                continue
            count += 1
            path, _, anchor = target.partition("#")
            file = (page.parent / path.partition("?")[0]).resolve() if path else page
            if not file.is_file() or (anchor and file.suffix == ".html" and anchor not in names(file)):
                broken.append(f"{page.relative_to(html)}: '{target}'")
    if broken:
        fail("links that lead nowhere, or elsewhere:\n" + "\n".join(broken))
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--pages-only", action="store_true")
    given = parser.parse_args()
    out, build = given.out.resolve(), given.build.resolve()
    if not given.pages_only and not list((build / "python" / "spherecut").glob("_core.*.so")):
        fail(f"{build} has no Python package (ninja -C {build} spherecut_python): the tutorials cannot be run")
    found = re.search(r"project\(spherecut VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())
    version = found.group(1) if found else ""
    stage(out, build, given.pages_only)
    stage_package(out, version)
    remove_old(out / "source", out / "html")
    environment = os.environ | {"SPHERECUT_DOXYGEN": "" if given.pages_only else str(out / "doxygen" / "xml"),
                                "SPHERECUT_DOCS_VERSION": version, "SPHERECUT_DOCS_PACKAGE": str(out / "package")}
    done = subprocess.run([sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", "-d", str(out / "doctrees"),
                           str(out / "source"), str(out / "html")], env=environment)
    if done.returncode != 0:
        fail("Sphinx has something to say (above)")
    copy_mathjax(out / "html")
    print(f"{len(list((out / 'html').rglob('*.html')))} pages, {check_links(out / 'html')} links")
    print(f"The site is {out / 'html' / 'index.html'}")


if __name__ == "__main__":
    main()
