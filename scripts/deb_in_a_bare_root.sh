#!/usr/bin/env bash
# Installs the Debian package into a fresh Debian that has nothing else, and runs the demonstration there, without a
# compiler: deb_in_a_bare_root.sh DEB [RESULTS]
# Needs root, the network and debootstrap (installed when missing). SPHERECUT_MIRROR: where Debian comes from. What the
# demonstration wrote is copied to RESULTS (default: out/bare_root, which must not be there). Exits 1 when anything is missing.
set -euo pipefail
source=$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)

say() { printf '%s\n' "$*"; }
fail() {
  printf 'deb_in_a_bare_root.sh: %s\n' "$*" >&2
  exit 1
}
usage() {
  printf 'Usage: %s DEB [RESULTS]\n' "$0" >&2
  exit 2
}
if [ $# -lt 1 ] || [ $# -gt 2 ]; then usage; fi
deb=$(readlink -f "$1")
results=${2:-$source/out/bare_root}
[ -f "$deb" ] || fail "$1: there is no such file (./dev package makes it)"
[ ! -e "$results" ] || fail "$results is there already"
[ "$(id -u)" = 0 ] || fail "run it as root: it makes a file system of its own"
mirror=${SPHERECUT_MIRROR:-http://deb.debian.org/debian}
command -v debootstrap >/dev/null || DEBIAN_FRONTEND=noninteractive apt-get -q -y install --no-install-recommends debootstrap >/dev/null

work=$(mktemp -d -p "${TMPDIR:-/var/tmp}")
root=$work/root
home=/srv/demo # of the ordinary user in there
cleanup() {
  if mountpoint -q "$root/proc"; then umount "$root/proc"; fi
  rm -rf --one-file-system "$work"
}
trap cleanup EXIT
inside() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }
as_user() { inside setpriv --reuid=1000 --regid=1000 --clear-groups env HOME="$home" "$@"; }
# logged WHAT COMMAND...: quiet, with the end of what was said when it fails.
logged() {
  local what=$1
  shift
  "$@" >"$work/log" 2>&1 || {
    tail -n 25 "$work/log" >&2
    fail "$what failed"
  }
}

start=$SECONDS
logged debootstrap debootstrap --variant=minbase bookworm "$root" "$mirror"
say "bare Debian: $(du -smx "$root" | cut -f 1) MB, $(inside dpkg-query -W | wc -l) packages, $((SECONDS - start)) s"
mount -t proc proc "$root/proc" 2>/dev/null || mount --bind /proc "$root/proc" || fail "/proc cannot be mounted in the new root"

start=$SECONDS
cp "$deb" "$root/srv/"
logged "apt-get update" inside apt-get -q update
logged "apt-get install" inside apt-get -q -y install "/srv/$(basename "$deb")"
say "with $(basename "$deb") ($(du -k "$deb" | cut -f 1) kB): $(du -smx "$root" | cut -f 1) MB, $(inside dpkg-query -W | wc -l) packages, $((SECONDS - start)) s"
for compiler in cc gcc g++ c++ clang cmake ninja make; do
  if inside sh -c "command -v $compiler" >/dev/null; then fail "$compiler is there: this shows nothing"; fi
done
say "no compiler, no CMake"

mkdir -p "$root$home"
chown 1000:1000 "$root$home"
start=$SECONDS
as_user sh -c 'cd && spherecut run /usr/share/spherecut/scenarios/liver_cut.toml --out results' || fail "the demonstration failed"
say "the demonstration took $((SECONDS - start)) s"
for file in forces.csv cuts.csv summary.json series.pvd; do
  [ -s "$root$home/results/$file" ] || fail "the demonstration has not written $file"
done
[ "$(find "$root$home/results" -name '*.png' -size +1k | wc -l)" -ge 1 ] || fail "the demonstration has drawn no figure"

as_user python3 -c '
import numpy as np, spherecut as sc
domain = sc.Domain.box([-0.02, -0.02, 0], [0.02, 0.02, 0.02], 0.004)
nodes = sc.sprinkle(domain, sc.Spacing(0.004)).nodes
body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))], body_force=[0, 0, -1e4])
print(f"Python: spherecut {sc.__version__}, {len(nodes)} nodes, residual {body.residual(body.solve()):.1e}")' || fail "the Python package does not work"
for installed in include/spherecut/solvers/body/discretisation.hpp lib/cmake/spherecut/spherecutConfig.cmake lib/libspherecut_app.a \
  share/spherecut/page/index.html share/doc/spherecut/README.md share/doc/spherecut/html/index.html; do
  [ -s "$root/usr/$installed" ] || fail "/usr/$installed is not installed"
done

mkdir -p "$(dirname "$results")"
cp -r "$root$home/results" "$results"
start=$SECONDS
logged "apt-get purge" inside apt-get -q -y purge spherecut
left=$(find "$root/usr" -name '*spherecut*' | head -n 3)
[ -z "$left" ] || fail "removed, the package leaves $left"
say "removed without a trace; results of the demonstration are in $results"
