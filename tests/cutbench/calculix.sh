#!/usr/bin/env bash
# Two cases of CutBench through CalculiX, and their score: calculix.sh PYTHON FOLDER
# Exits 77 (skipped) and says why when ccx is not installed.
set -euo pipefail
source=$(cd "$(dirname "$(readlink -f "$0")")/../.." && pwd)
python=$1 folder=$2
export PYTHONDONTWRITEBYTECODE=1 OPENBLAS_NUM_THREADS=1

command -v ccx >/dev/null || {
  printf '\n  NOTE: THE CASES OF CUTBENCH IN CALCULIX ARE SKIPPED: the Debian package calculix-ccx is not installed\n\n'
  exit 77
}
rm -rf "$folder"
"$python" "$source/benchmarks/cutbench/to_calculix.py" --out "$folder" --run --result "$folder/calculix.json" severed_bar straight_crack
"$python" "$source/benchmarks/cutbench/score.py" "$folder/calculix.json" | tee "$folder/score.txt"
grep -q "^4 of 4 values within their tolerance$" "$folder/score.txt"
