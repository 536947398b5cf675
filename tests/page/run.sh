#!/usr/bin/env bash
# One test of the page under node: run.sh NODE BUILD_FOLDER unit|browser [ARGUMENTS]. Exits 77 (skipped) and says why when the
# page was not built or there is no browser.
set -euo pipefail
node=$1 build=$2 kind=$3
shift 3

skip() {
  printf '\n  NOTE: THE TESTS OF THE PAGE ARE SKIPPED (%s): %s\n\n' "$kind" "$1"
  exit 77
}
[ -e "$build/page/index.html" ] || skip "the page is not built; that needs nodejs, npm and, once, the network"
if [ "$kind" = unit ]; then
  exec "$node" --test "$build/page-tests/protocol.test.mjs" "$build/page-tests/surface.test.mjs"
fi
command -v chromium >/dev/null || skip "the Debian package chromium is not installed"
exec timeout 280 "$node" "$build/page-tests/browser.test.mjs" "$build" "$@"
