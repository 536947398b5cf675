#!/usr/bin/env bash
# Formatting, clang-tidy, shell syntax and types of the page over all tracked sources.
# Usage: scripts/lint.sh BUILD_FOLDER [--deep]
# --deep runs clang's path-sensitive analyzer on every unit, which doubles the time; without it, it looks only where a
# .clang-tidy asks for it.
# clang-tidy leaves out units that include CGAL, OpenVDB or FCL: their headers take minutes and a gigabyte each.
# What a unit said is kept under a hash of all it depends on, so that a repeat checks only what changed.
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/.."
build=${1:?usage: scripts/lint.sh BUILD_FOLDER [--deep]}
case ${2:-} in
'') checks= ;;
--deep) checks=clang-analyzer-core*,clang-analyzer-cplusplus* ;;
*)
  printf "lint: unknown option '%s'; allowed: --deep\n" "$2" >&2
  exit 2
  ;;
esac
export checks
[ -f "$build/compile_commands.json" ] || {
  printf 'lint: %s/compile_commands.json is missing; run ./dev build first\n' "$build" >&2
  exit 2
}

mapfile -t sources < <(git ls-files --cached --others --exclude-standard '*.cpp' '*.hpp' '*.inl')
mapfile -t shells < <(git ls-files --cached --others --exclude-standard dev .ci/run '*.sh')
status=0

for shell in "${shells[@]}"; do
  bash -n "$shell" || status=1
done
clang-format-14 --dry-run -Werror "${sources[@]}" || status=1
printf 'lint: %d sources formatted, %d shell scripts parsed\n' "${#sources[@]}" "${#shells[@]}"

page=src/viewer/page
if [ -e $page/node_modules/typescript/bin/tsc ]; then
  (cd $page && node node_modules/typescript/bin/tsc --noEmit) || status=1
  printf 'lint: types of the page checked\n'
else
  printf 'lint: the packages of the page are not installed (./dev build does it): its types are not checked\n'
fi

# unit <tab> files it includes, itself first, following the project's own quoted includes.
dependencies() {
  awk '
    FNR == 1 { files[++count] = FILENAME }
    /^#include "/ { split($0, part, "\""); includes[FILENAME] = includes[FILENAME] " " part[2] }
    function visit(file,   names, n, i) {
      if (file in seen) return
      seen[file] = 1; closure = closure " " file
      n = split(includes[file], names, " ")
      for (i = 1; i <= n; i++) visit(names[i])
    }
    END {
      for (f = 1; f <= count; f++) {
        if (files[f] !~ /\.cpp$/) continue
        split("", seen); closure = ""; visit(files[f]); print files[f] "\t" substr(closure, 2)
      }
    }' "${sources[@]}"
}

cache=$build/lint
mkdir -p "$cache"
tool=$(clang-tidy-14 --version | tr '\n' ' ')
heavy='#include [<"](CGAL|openvdb|fcl)/'
pending=()
checked=0
while IFS=$'\t' read -r unit closure; do
  # Tests are formatted and compiled with warnings as errors; clang-tidy reads what ships.
  [[ $unit == tests/* ]] && continue
  # shellcheck disable=SC2086
  if grep -qE "$heavy" $closure 2>/dev/null || ! grep -qF "/$unit\"" "$build/compile_commands.json"; then
    continue
  fi
  checked=$((checked + 1))
  # shellcheck disable=SC2086
  key=$({ printf '%s\n' "$tool" "$checks"; cat .clang-tidy src/*/.clang-tidy cmake/*.cmake $closure 2>/dev/null || true; } | sha256sum | cut -c 1-32)
  [ -e "$cache/$key" ] || pending+=("$key $unit")
done < <(dependencies)
printf 'lint: clang-tidy on %d units, %d of them changed\n' "$checked" "${#pending[@]}"

check_unit() { # CACHE BUILD KEY UNIT
  local said
  if said=$(clang-tidy-14 --quiet ${checks:+"--checks=$checks"} -p "$2" "$4" 2>/dev/null); then
    : >"$1/$3"
  else
    printf '%s\n' "$said"
    return 1
  fi
}
export -f check_unit
if [ ${#pending[@]} -gt 0 ]; then
  printf '%s\n' "${pending[@]}" | xargs -P "${SPHERECUT_JOBS:-$(nproc)}" -L 1 bash -c 'check_unit "$@"' lint "$cache" "$build" || status=1
fi
if [ "$status" = 0 ]; then printf 'lint: clean\n'; else printf 'lint: see above\n' >&2; fi
exit "$status"
