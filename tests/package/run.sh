#!/usr/bin/env bash
# What cpack makes: run.sh BUILD_FOLDER WORK KIND [PYTHON]
#   deb      the Debian package, unpacked (not installed: scripts/deb_in_a_bare_root.sh does that): its program and its Python
#            package work from there, everything that is promised is in it, and it knows what it depends on
#   source   the archive of the sources holds the files of the repository and nothing else
# Exits 77 (skipped) and says why where a tool is missing.
set -euo pipefail
source=$(cd "$(dirname "$(readlink -f "$0")")/../.." && pwd)
build=$(readlink -f "$1") work=$2/$3 kind=$3 python=${4:-}

skip() {
  printf '\n  NOTE: THIS TEST IS SKIPPED (%s): %s\n\n' "$kind" "$1"
  exit 77
}
fail() {
  printf 'tests/package/run.sh: %s\n' "$*" >&2
  exit 1
}
rm -rf "$work"
mkdir -p "$work"

case $kind in
deb)
  if ! command -v dpkg-shlibdeps >/dev/null || ! command -v file >/dev/null; then skip "dpkg-dev or file is not installed"; fi
  cpack --config "$build/CPackConfig.cmake" -B "$work" -D CPACK_DEBIAN_COMPRESSION_TYPE=none >"$work/log" 2>&1 || {
    tail -n 20 "$work/log" >&2
    fail "cpack failed"
  }
  deb=$(find "$work" -maxdepth 1 -name 'spherecut_*_*.deb')
  [ -n "$deb" ] || fail "there is no package"
  for field in 'Depends:.*gnuplot-nox' 'Depends:.*libopenvdb' 'Depends:.*libcholmod' 'Architecture: amd64' 'Version: [0-9.]*$'; do
    dpkg-deb -f "$deb" | grep -q "$field" || fail "the package does not say '$field'"
  done
  dpkg-deb -x "$deb" "$work/unpacked"
  usr=$work/unpacked/usr
  for name in include/spherecut/solvers/body/discretisation.hpp lib/cmake/spherecut/spherecutConfig.cmake lib/libspherecut_app.a \
    share/doc/spherecut/README.md share/doc/spherecut/LICENSE share/doc/spherecut/CITATION.cff share/doc/spherecut/examples/libraries/palpate.cpp share/doc/spherecut/docs/start.md share/doc/spherecut/examples/python/press_a_liver.py; do
    [ -s "$usr/$name" ] || fail "the package has no /usr/$name"
  done
  diff -r "$source/scenarios" "$usr/share/spherecut/scenarios"
  ! grep -rlF "$build" "$usr/lib/cmake" "$usr/include" || fail "these know where they were built"
  # Not from a folder in which the sources' scenarios are.
  (cd "$work" && "$usr/bin/spherecut" check "$usr/share/spherecut/scenarios/liver_cut.toml")
  if [ -n "$python" ] && ls "$build"/python/spherecut/_core*.so >/dev/null 2>&1; then
    (cd "$work" && PYTHONPATH=$usr/lib/python3/dist-packages "$python" -c '
import spherecut as sc
assert sc.__file__.startswith("'"$usr"'"), sc.__file__
print(sc.__version__, sc.Surface)')
  fi
  ;;
source)
  git -C "$source" rev-parse --is-inside-work-tree >/dev/null 2>&1 || skip "these sources are in no git repository"
  cpack --config "$build/CPackSourceConfig.cmake" -B "$work" >"$work/log" 2>&1 || {
    tail -n 20 "$work/log" >&2
    fail "cpack failed"
  }
  archive=$(find "$work" -maxdepth 1 -name 'spherecut-*-source.tar.gz')
  [ -n "$archive" ] || fail "there is no archive"
  tar -tzf "$archive" | grep -v '/$' | cut -d / -f 2- | sort >"$work/packed"
  # Files that are not ignored count: what is about to be committed belongs to it.
  (cd "$source" && git ls-files --cached --others --exclude-standard | while read -r name; do [ ! -e "$name" ] || printf '%s\n' "$name"; done) |
    sort >"$work/expected"
  diff "$work/expected" "$work/packed" || fail "the archive does not hold the files of the repository (< missing, > too much)"
  printf '%s files\n' "$(wc -l <"$work/packed")"
  ;;
*) fail "unknown kind '$kind'" ;;
esac
