#!/usr/bin/env bash
# The pages as a site, without the examples and without Doxygen: site.sh BUILD_FOLDER OUT. Warnings and links that lead nowhere
# are errors. Exits 77 (skipped) and says why where Sphinx or what it needs is not installed.
set -euo pipefail
source=$(cd "$(dirname "$(readlink -f "$0")")/../.." && pwd)
if ! /usr/bin/python3 -c "import sphinx, myst_parser, furo" 2>/dev/null || [ ! -e /usr/share/javascript/mathjax/MathJax.js ]; then
  printf '\n  NOTE: THE SITE OF THE DOCUMENTATION IS NOT TESTED: Sphinx is not installed (docs/site/debian-packages.txt)\n\n'
  exit 77
fi
/usr/bin/python3 "$source/docs/site/build.py" --build "$1" --out "$2" --pages-only
