"""Settings of Sphinx; docs/site/build.py stages the pages and runs it."""

import logging
import os
import re
import sys

sys.path.insert(0, os.environ["SPHERECUT_DOCS_PACKAGE"])

project = "Spherecut"
author = "The Spherecut maintainers"
copyright = author
version = release = os.environ["SPHERECUT_DOCS_VERSION"]

extensions = ["myst_parser", "sphinx.ext.mathjax", "sphinx.ext.autodoc"]
doxygen = os.environ["SPHERECUT_DOXYGEN"]
if doxygen:
    extensions.append("breathe")
    breathe_projects = {"spherecut": doxygen}
    breathe_default_project = "spherecut"
    breathe_default_members = ("members", "undoc-members")
    breathe_show_include = False
exclude_patterns = ["**/*.source"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_digits = False
myst_heading_anchors = 4
myst_update_mathjax = False
suppress_warnings = ["myst.header"]

# MathJax 2 of Debian, beside the pages: build.py copies it.
mathjax_path = "mathjax/MathJax.js?config=TeX-AMS_SVG-full"
mathjax2_config = {
    "tex2jax": {"inlineMath": [["\\(", "\\)"]], "displayMath": [["\\[", "\\]"]], "processRefs": False, "processEnvironments": False,
                "ignoreClass": "tex2jax_ignore|mathjax_ignore|document", "processClass": "math"},
    "SVG": {"font": "TeX"},
    "showMathMenu": False,
    "messageStyle": "none",
}

html_theme = "furo"
html_title = f"Spherecut {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
pygments_style = "friendly"
highlight_language = "text"
add_module_names = False
autoclass_content = "both"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
autodoc_type_aliases = {"npt.ArrayLike": "npt.ArrayLike", "Array": "Array", "Observation": "Observation", "Reward": "Reward"}
nitpicky = False


# Breathe declares the namespaces of a header on the header's page, and Sphinx warns that they are on another page too. A
# lambda as a default value is shown as it is written; Sphinx warns that it does not understand it.
class NotWarnings(logging.Filter):
    def filter(self, record: logging.LogRecord) -> bool:
        text = record.getMessage()
        namespace = re.search(r"Declaration is '\.\. cpp:type:: (spherecut|topology|solvers|app)'", text)
        fallback = "Using fallback parser" in text and re.search(r"= ?\[\] ?[({]", text)
        return not namespace and not fallback


for name in ("sphinx.sphinx.domains.cpp", "sphinx.sphinx.util.cfamily"):
    logging.getLogger(name).addFilter(NotWarnings())


def plain_docstrings(app, what, name, obj, options, lines):
    """Docstrings of the compiled module are plain text: what reST would take for markup is literal."""
    module = sys.modules.get("spherecut._core")
    owner = name.split(".")[1] if name.count(".") else ""
    if name.startswith("spherecut.env") or name.startswith("spherecut.sweep") or not hasattr(module, owner):
        return
    for k, line in enumerate(lines):
        line = line.replace("\\", "\\\\").replace("*", "\\*").replace("|", "\\|")
        line = re.sub(r"(?<!`)\b((?:\w+\.)*\w+\(\))", r"``\1``", line)
        lines[k] = re.sub(r"(?<![`\w])(\w+_)(?!\w)", r"``\1``", line)


def setup(app):
    app.connect("autodoc-process-docstring", plain_docstrings)
