#!/usr/bin/env bash
# Formatting, clang-tidy, shell syntax and types of the page over all tracked sources; the pages by scripts/lint_docs.py;
# functions that nobody calls by scripts/unused_functions.py.
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
jobs=${SPHERECUT_JOBS:-$(nproc)}
printf '%s\0' "${sources[@]}" | xargs -0 -P "$jobs" -n 40 clang-format-14 --dry-run -Werror || status=1
printf 'lint: %d sources formatted, %d shell scripts parsed\n' "${#sources[@]}" "${#shells[@]}"

scripts/lint_docs.py || status=1
scripts/unused_functions.py --only-dead || status=1

page=src/viewer/page
if [ -e $page/node_modules/typescript/bin/tsc ]; then
  (cd $page && node node_modules/typescript/bin/tsc --noEmit) || status=1
  printf 'lint: types of the page checked\n'
else
  printf 'lint: the packages of the page are not installed (./dev build does it): its types are not checked\n'
fi

# The units of what ships as they are compiled: sources by themselves, and those that hold several of them. Tests are
# formatted and compiled with warnings as errors.
root=$PWD
mapfile -t units < <(sed -n 's/^ *"file": "\(.*\)",\{0,1\}$/\1/p' "$build/compile_commands.json" | sed "s#^$root/##" |
  grep -vE "^($build/)?tests/" | sort -u)

# unit <tab> 1 when it includes a heavy library, else 0 <tab> files it includes, itself first, following the project's own
# quoted includes.
dependencies() {
  printf '%s\n' "${units[@]}" "${sources[@]}" | sort -u | awk -v root="$root/" -v compiled="$(printf '%s\n' "${units[@]}")" '
    function scan(file,   line, part) {
      while ((getline line < file) > 0) {
        if (line ~ /^#include [<"](CGAL|openvdb|fcl)\//) heavy[file] = 1
        if (line !~ /^#include "/) continue
        split(line, part, "\"")
        if (index(part[2], root) == 1) part[2] = substr(part[2], length(root) + 1)
        includes[file] = includes[file] " " part[2]
      }
      close(file)
    }
    function visit(file,   names, n, i) {
      if (file in seen || !(file in known)) return
      seen[file] = 1; closure = closure " " file
      if (file in heavy) is_heavy = 1
      n = split(includes[file], names, " ")
      for (i = 1; i <= n; i++) visit(names[i])
    }
    { known[$0] = 1; scan($0) }
    END {
      count = split(compiled, list, "\n")
      for (u = 1; u <= count; u++) {
        split("", seen); closure = ""; is_heavy = 0; visit(list[u])
        print list[u] "\t" is_heavy "\t" substr(closure, 2)
      }
    }'
}

cache=$build/lint
mkdir -p "$cache"
tool=$(clang-tidy-14 --version | tr '\n' ' ')
pending=()
checked=0
sources_checked=0
while IFS=$'\t' read -r unit is_heavy closure; do
  [ "$is_heavy" = 1 ] && continue
  mapfile -t members < <(tr ' ' '\n' <<<"$closure" | grep '\.cpp$')
  sources_checked=$((sources_checked + ${#members[@]}))
  checked=$((checked + 1))
  # The settings of a folder hold for its sources wherever they are compiled.
  settings=$(dirname "${members[0]}")/.clang-tidy
  [ -e "$settings" ] || settings=.clang-tidy
  # shellcheck disable=SC2086
  key=$({ printf '%s\n' "$tool" "$checks"; cat .clang-tidy "$settings" cmake/*.cmake $closure; } | sha256sum | cut -c 1-32)
  [ -e "$cache/$key" ] || pending+=("$key $unit $settings")
done < <(dependencies)
printf 'lint: clang-tidy on %d sources in %d units, %d of them changed\n' "$sources_checked" "$checked" "${#pending[@]}"

check_unit() { # CACHE BUILD KEY UNIT SETTINGS
  local said
  if said=$(clang-tidy-14 --quiet --extra-arg=-Wno-unknown-warning-option --config-file="$5" ${checks:+"--checks=$checks"} -p "$2" "$4" 2>/dev/null); then
    : >"$1/$3"
  else
    printf '%s\n' "$said"
    return 1
  fi
}
export -f check_unit
if [ ${#pending[@]} -gt 0 ]; then
  # Those that the analyzer looks at take longest and come first.
  printf '%s\n' "${pending[@]}" | LC_ALL=C sort -k 3,3r -k 2,2 | xargs -P "$jobs" -L 1 bash -c 'check_unit "$@"' lint "$cache" "$build" || status=1
fi
if [ "$status" = 0 ]; then printf 'lint: clean\n'; else printf 'lint: see above\n' >&2; fi
exit "$status"
