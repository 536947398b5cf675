#!/usr/bin/env python3
"""Writes cases as CalculiX input: a block of quadratic hexahedra with the cut's nodes doubled, and runs them.

to_calculix.py --out FOLDER [--refine N] [CASE...]                  writes CASE.inp
to_calculix.py --out FOLDER --run --result FILE [--refine N] [CASE...]   also runs ccx and writes a result file

Without CASE: all that such a block can hold. Ends with 3 when ccx fails, with 77 when it is not installed.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from cutbench import BadInput, case_names, chosen_cases, error_of, moduli_of, read_case, run_main, write_result
from grid import case_forces, face_shapes, given_displacements, make_grid

ELEMENT = "C3D20"


class RunFailed(RuntimeError):
    pass


def can_hold(case):
    return case.get("cut", {}).get("shape") != "cap" and case.get("tool", {}).get("shape") != "ball"


def lists(numbers, width=8):
    numbers = [str(k + 1) for k in numbers]
    return [", ".join(numbers[k:k + width]) + ("," if k + width < len(numbers) else "") for k in range(0, len(numbers), width)]


def input_text(case, grid):
    given, forces = given_displacements(case, grid), case_forces(case, grid, 2)
    lines = ["*HEADING", case["title"], "*NODE, NSET=ALL"]
    lines += [f"{k + 1}, " + ", ".join(f"{value:.12g}" for value in x) for k, x in enumerate(grid.nodes)]
    lines.append(f"*ELEMENT, TYPE={ELEMENT}, ELSET=TISSUE")
    for k, element in enumerate(grid.elements):
        lines += lists([k, *element], 11)
    if len(grid.pairs):
        lines += ["*NSET, NSET=LIPS", *lists(sorted(set(grid.pairs.ravel())))]
    for quantity in case["quantities"]:
        if quantity["kind"] in ("reaction", "tool_force"):
            members = grid.face_nodes["tool" if quantity["kind"] == "tool_force" else quantity["where"]]
            lines += [f"*NSET, NSET={quantity['name'].upper()}", *lists(members)]
    modulus, ratio = moduli_of(case)
    lines += ["*MATERIAL, NAME=TISSUE", "*ELASTIC", f"{modulus:.12g}, {ratio:.12g}", "*SOLID SECTION, ELSET=TISSUE, MATERIAL=TISSUE", "*STEP", "*STATIC"]
    lines.append("*BOUNDARY")
    lines += [f"{node + 1}, {axis + 1}, {axis + 1}, {value:.12g}" for (node, axis), value in sorted(given.items())]
    loaded = [(k, axis) for k, axis in zip(*np.nonzero(forces))]
    if loaded:
        lines.append("*CLOAD")
        lines += [f"{k + 1}, {axis + 1}, {forces[k, axis]:.12g}" for k, axis in loaded]
    if len(grid.pairs):
        lines += ["*NODE PRINT, NSET=LIPS", "U"]
    for quantity in case["quantities"]:
        if quantity["kind"] in ("reaction", "tool_force"):
            lines += [f"*NODE PRINT, NSET={quantity['name'].upper()}, TOTALS=ONLY", "RF"]
    return "\n".join([*lines, "*END STEP"]) + "\n"


def run(folder, name):
    """Text of the .dat file."""
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    output = folder / f"{name}.dat"
    if done.returncode != 0 or not output.is_file() or "Job finished" not in done.stdout:
        raise RunFailed(f"ccx -i {name} ended with {done.returncode}: {(done.stdout + done.stderr).strip().splitlines()[-1:]}")
    return output.read_text()


def displacements(text, grid):
    """(n, 3), m, zero but for the nodes that were printed."""
    found = np.zeros_like(grid.nodes)
    block = re.search(r"displacements .*?\n\n(.*?)(?:\n\n|\Z)", text, re.S)
    for line in block[1].splitlines() if block else []:
        number, *values = line.split()
        found[int(number) - 1] = [float(value) for value in values]
    return found


def total_force(text, name):
    found = re.search(rf"total force \(fx,fy,fz\) for set {name.upper()} .*?\n\n\s*(\S+)\s+(\S+)\s+(\S+)", text)
    if not found:
        raise RunFailed(f"the .dat file has no total force of the set {name.upper()}")
    return np.array([float(value) for value in found.groups()])


class Opening:
    """Jump of the displacement across the cut, anywhere on it, by the shape functions of the faces."""

    def __init__(self, grid, displacement):
        self.grid, self.displacement = grid, displacement
        self.other = dict(map(tuple, grid.pairs))
        self.faces = grid.faces["cut+"]
        self.middles = grid.nodes[self.faces].mean(axis=1)

    def __call__(self, point):
        for k in np.argsort(np.linalg.norm(self.middles - point, axis=1))[:12]:
            x = self.grid.nodes[self.faces[k]]
            at = np.zeros(2)
            for _ in range(20):
                shape, slope = face_shapes(2, *at)
                at += np.linalg.lstsq((slope @ x).T, point - shape @ x, rcond=None)[0]
                at = np.clip(at, -1.5, 1.5)
            shape, _ = face_shapes(2, *at)
            if np.abs(at).max() < 1 + 1e-6 and np.linalg.norm(shape @ x - point) < 1e-6 * np.ptp(x, axis=0).max():
                mine = self.displacement[self.faces[k]]
                others = self.displacement[[self.other.get(node, node) for node in self.faces[k]]]
                return shape @ (mine - others)
        raise RunFailed(f"no face of the cut has the point {point}")


def ahead_at(cut, point):
    away = np.array(point) - cut["centre"]
    if cut["shape"] == "rectangle":
        return np.array([np.sign(away[0]), 0.0, 0.0])
    half = np.array(cut.get("half_axes") or [cut["radius"]] * 2)
    way = np.array([*(away[:2] / half**2), 0.0])
    return way / np.linalg.norm(way)


def intensities(case, opening, point):
    """By displacement correlation: K of the jump at seven distances behind the front, carried on to the front by a line."""
    cut, (modulus, ratio) = case["cut"], moduli_of(case)
    size = min(cut.get("half_axes") or [cut.get("radius") or 0.5 * cut["lengths"][0]])
    ahead, normal = ahead_at(cut, point), np.array(cut["normal"], float)
    frame = np.array([normal, ahead, np.cross(normal, ahead)])
    factors = np.array([modulus / (8 * (1 - ratio**2))] * 2 + [modulus / (8 * (1 + ratio))])
    distances = size * np.linspace(0.1, 0.4, 7)
    found = [factors * np.sqrt(2 * np.pi / r) * (frame @ opening(np.array(point) - r * ahead)) for r in distances]
    return np.polyfit(distances, np.array(found), 1)[1]


def values_of(case, grid, text):
    values = {}
    opening = Opening(grid, displacements(text, grid)) if len(grid.pairs) else None
    for quantity in case["quantities"]:
        if quantity["kind"] == "jump":
            found = [opening(np.array(point))["xyz".index(quantity["axis"])] for point in quantity["points"]]
        elif quantity["kind"] == "intensity":
            found = [intensities(case, opening, point)[quantity["mode"] - 1] for point in quantity["points"]]
        elif quantity["kind"] == "reaction":
            found = [total_force(text, quantity["name"])["xyz".index(quantity["axis"])]]
        else:
            found = [-total_force(text, quantity["name"])[2]]  # of the tissue on the tool
        values[quantity["name"]] = [float(value) for value in found]
    return values


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--run", action="store_true")
    parser.add_argument("--result", type=Path, metavar="FILE")
    parser.add_argument("--refine", type=int, default=1, metavar="N", help="multiplies the elements a line, 1 to 8")
    given = parser.parse_args()
    if not 1 <= given.refine <= 8:
        raise BadInput(f"--refine {given.refine}: out of range; allowed: 1 to 8")
    if given.run != (given.result is not None):
        raise BadInput("--run and --result FILE go together")
    if given.run and shutil.which("ccx") is None:
        print("cutbench: ccx is not installed (Debian's calculix-ccx): nothing is run", file=sys.stderr)
        return 77
    cases = chosen_cases(given.cases) if given.cases else [case for case in map(read_case, case_names()) if can_hold(case)]
    grids = [make_grid(case, 2, given.refine) for case in cases]
    try:
        given.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{given.out}: {error.strerror}") from None
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.split()[-1] if given.run else ""
    result = {"code": "CalculiX", "version": version, "command": f"to_calculix.py --run --refine {given.refine}", "cases": {}}
    for case, grid in zip(cases, grids):
        (given.out / f"{case['name']}.inp").write_text(input_text(case, grid))
        told = ""
        if given.run:
            try:
                values = values_of(case, grid, run(given.out, case["name"]))
            except RunFailed as error:
                print(f"cutbench: {case['name']}: {error}", file=sys.stderr)
                return 3
            result["cases"][case["name"]] = {"nodes": len(grid.nodes), "values": values}
            told = ": off by " + ", ".join(f"{q['name']} {100 * error_of(q, values[q['name']]):.2f} %" for q in case["quantities"])
        print(f"{case['name']}.inp, {len(grid.nodes)} nodes{told}", flush=True)
    if given.run:
        write_result(given.result, result)
    return 0


if __name__ == "__main__":
    run_main(main)
