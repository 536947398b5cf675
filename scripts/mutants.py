#!/usr/bin/env python3
"""Spot checks of the tests: changes one place of a kernel at a time and tells whether some test notices.

Every mutant is put into the source, its test program is built and its tests run until one fails; then the source is put
back. A mutant that no test notices is told, and the exit status is 1. Takes a minute or two each.
"""
import argparse
import dataclasses
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


@dataclasses.dataclass
class Mutant:
    kernel: str
    file: str
    before: str
    after: str
    program: str
    tests: str  # a regular expression of ctest


MUTANTS = [
    Mutant("shape functions: slope of the weight", "solvers/shapes/kernel_lanes.inl",
           "12 * t2 * q, t};", "12.1 * t2 * q, t};", "test_solvers", "^solvers:.*([Ss]hape|gradient)"),
    Mutant("galerkin: stiffness of a pair of nodes", "solvers/galerkin/stiffness_tiles.hpp",
           "+= mu * g.trace()", "+= lambda * g.trace()", "test_solvers", "^solvers:.*(patch|smooth|[Gg]alerkin)"),
    Mutant("collocation: flux through a face", "solvers/collocation/balance_rows.cpp",
           "lambda_area = -lambda_ * area", "lambda_area = -0.9 * lambda_ * area", "test_solvers",
           "^solvers:.*(patch|linear|[Cc]ollocation)"),
    Mutant("neo-Hookean law: energy", "solvers/elasticity/neo_hookean.inl",
           "0.5 * shear * (shape * trace - 3.0)", "0.6 * shear * (shape * trace - 3.0)", "test_elasticity",
           "^solvers:.*([Ll]aw|energy)"),
    Mutant("interaction integral: curvature of the front", "solvers/fracture/stress_intensity.cpp",
           "+ 2 * c * here(2, 0)", "+ c * here(2, 0)", "test_solvers", "^solvers:.*([Ii]ntensit|integral)"),
    Mutant("sight lines: edge of a triangle", "topology/incision/incision.cpp",
           "u + v <= 1 + slack", "u + v <= 0.999 + slack", "test_topology",
           "^topology:.*([Ss]ight|block|[Ii]ncision|sheet)"),
    Mutant("condensed contact: side of a candidate", "solvers/algebra/linear_complementarity.cpp",
           "open[k] < -tolerance", "open[k] < -tolerance - 1e-6", "test_solvers",
           "^solvers:.*([Cc]omplement|[Cc]ontact|press)"),
]


def survives(mutant, build):
    path = ROOT / mutant.file
    text = path.read_text(encoding="utf-8")
    if text.count(mutant.before) != 1:
        raise SystemExit(f"{mutant.file}: {text.count(mutant.before)} places read {mutant.before!r}; one is needed")
    try:
        path.write_text(text.replace(mutant.before, mutant.after), encoding="utf-8")
        subprocess.run(["cmake", "--build", build, "--target", mutant.program], check=True, stdout=subprocess.DEVNULL)
        tests = subprocess.run(["ctest", "--test-dir", build, "-R", mutant.tests, "--stop-on-failure",
                                "--no-tests=error"], check=False, capture_output=True, text=True)
    finally:
        path.write_text(text, encoding="utf-8")
    failed = [line for line in tests.stdout.splitlines() if "***Failed" in line or "***Exception" in line]
    print(f"{mutant.kernel}: " + (f"noticed by {failed[0].split(':', 1)[1].split('.....')[0].strip()}" if failed
                                  else "NOT NOTICED"), flush=True)
    return not failed


def main():
    numbers = range(1, len(MUTANTS) + 1)
    parser = argparse.ArgumentParser(description="Changes one place of a kernel at a time; does some test notice?")
    parser.add_argument("build", help="a configured build folder, such as build/release")
    parser.add_argument("number", nargs="*", type=int, help="of the mutants in this file; all of them")
    arguments = parser.parse_args()
    build = arguments.build
    for number in arguments.number:
        if number not in numbers:
            parser.error(f"there is no mutant {number}; allowed: 1 to {len(MUTANTS)}")
    if not (pathlib.Path(build) / "CMakeCache.txt").is_file():
        parser.error(f"{build} is not a configured build folder")
    mutants = [MUTANTS[number - 1] for number in arguments.number or numbers]
    survivors = [mutant for mutant in mutants if survives(mutant, build)]
    for program in sorted({mutant.program for mutant in mutants}):
        subprocess.run(["cmake", "--build", build, "--target", program], check=True, stdout=subprocess.DEVNULL)
    sys.exit(1 if survivors else 0)


if __name__ == "__main__":
    main()
