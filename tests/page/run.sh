#!/usr/bin/env bash
# The page of `spherecut serve` under test: run.sh BUILD_FOLDER KIND [ARGUMENTS]
#   unit             the protocol's decoder, the surface, what shading is computed from, words of the server, under node
#   browser [FOLDER] the page in Chromium against the server; pictures of it into a folder
#   seen             likewise: what it composites, however it draws, after resizing, hiding, a lost context
#   look             likewise: how it looks at first, tissue, wound, shadow, force, hint
#   controls         likewise: every control of the page, on a small block
#   tear             likewise: the grasper lifts a flap that tears
#   pictures FOLDER  pictures of the page, JPEG below 150 kB, for docs/images
#   moving_picture FILE  ten seconds of press, cut and tear, a moving WebP below 3 MB
#   measure          frame rate and latency at 20,000 triangles; exits 1 when they are not what was asked for
#   measure picture  what a picture takes, as a whole and for a tool alone
#   measure stroke [KEY=VALUE ...]  a wavy stroke of the blade: lag of the wound, force, mouth, as a table
#   soak SECONDS [SEED]  random pressing and cutting
# Exits 77 (skipped) and says why when the page was not built or there is no browser.
set -euo pipefail
source=$(cd "$(dirname "$(readlink -f "$0")")/../.." && pwd)
build=$1 kind=$2
shift 2
export OPENBLAS_NUM_THREADS=1

skip() {
  printf '\n  NOTE: THE TESTS OF THE PAGE ARE SKIPPED (%s): %s\n\n' "$kind" "$1"
  exit 77
}
node=$(command -v node || command -v nodejs) || skip "nodejs is not installed"
[ -e "$build/page/index.html" ] || skip "the page is not built; that needs nodejs, npm and, once, the network"
if [ "$kind" = unit ]; then
  exec "$node" --test "$build"/page-tests/{protocol,surface,trace,shading,advice}.test.mjs
fi
command -v chromium >/dev/null || skip "the Debian package chromium is not installed"
case $kind in browser | seen | look | controls | tear) kind=$kind.test ;; esac
exec "$node" "$build/page-tests/$kind.mjs" "$build" "$source" "$@"
