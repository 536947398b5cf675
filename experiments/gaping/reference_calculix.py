#!/usr/bin/env python3
"""Makes the stored table of the experiment `gaping` with CalculiX (Debian's calculix-ccx).

reference_calculix.py FOLDER FILE     works in FOLDER and writes FILE, the table

A quarter of the block, 0 <= x <= 1, 0 <= y <= 1/2, 0 <= z <= 1/4, of quadratic hexahedra C3D20R: z = 0 is a plane of symmetry, y = 0
is one from x = 1/2 on and a face of the cut before. The face y = 1/2 is bonded and moved along y by a tenth and a fifth.
Neo-Hookean, mu = 1, nu = 0.49: C10 = mu / 2, D1 = 2 / kappa. Two meshes: one with quarter points at the front, one with half its edges and
without.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

CUT, WIDTH, HALF_HEIGHT, HALF_DEPTH = 0.5, 1.0, 0.5, 0.25
SHEAR, RATIO = 1.0, 0.49
STRETCHES = (0.2, 0.4)
# Elements behind the front, ahead of it, along y, along z; whether the middle nodes of the edges that end at the front are at their quarters.
MESHES = (((4, 4, 6, 2), True), ((8, 8, 12, 4), False))


def corners(cells):
    """Corners of the elements along x, y and z, dense about the front. Those of the first mesh are corners of the second."""
    behind, ahead, up, deep = cells
    x = np.concatenate([CUT * (1 - np.linspace(1, 0, behind + 1) ** 1.6), CUT + (WIDTH - CUT) * np.linspace(0, 1, ahead + 1)[1:] ** 1.6])
    return x, HALF_HEIGHT * np.linspace(0, 1, up + 1) ** 1.5, np.linspace(0, HALF_DEPTH, deep + 1)


def halved(corners_of_axis):
    fine = np.empty(2 * len(corners_of_axis) - 1)
    fine[::2] = corners_of_axis
    fine[1::2] = 0.5 * (corners_of_axis[1:] + corners_of_axis[:-1])
    return fine


def mesh(cells, quarter):
    """Nodes by (i, j, k) of the halved grid, and elements of 20 nodes in CalculiX's order."""
    x, y, z = (halved(c) for c in corners(cells))
    number, nodes = {}, []
    for i, a in enumerate(x):
        for j, b in enumerate(y):
            for k, c in enumerate(z):
                if i % 2 + j % 2 + k % 2 <= 1:
                    number[i, j, k] = len(nodes) + 1
                    nodes.append((a, b, c))
    if quarter:
        front = 2 * cells[0]
        for (i, j, k), n in number.items():
            if j == 0 and abs(i - front) == 1:
                nodes[n - 1] = (x[front] + 0.25 * (x[2 * i - front] - x[front]), y[0], z[k])
            elif i == front and j == 1:
                nodes[n - 1] = (x[front], 0.25 * y[2], z[k])
    order = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
             (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
             (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)]
    elements = [[number[i + a, j + b, k + c] for a, b, c in order]
                for i in range(0, len(x) - 2, 2) for j in range(0, len(y) - 2, 2) for k in range(0, len(z) - 2, 2)]
    return np.array(nodes), elements


def lines_of(name, members):
    members = [str(m) for m in members]
    return [f"*NSET, NSET={name}"] + [", ".join(members[k:k + 8]) + ("," if k + 8 < len(members) else "") for k in range(0, len(members), 8)]


def input_text(nodes, elements):
    bulk = 2 * SHEAR * (1 + RATIO) / (3 * (1 - 2 * RATIO))
    near = 1e-9
    sets = {
        "ALONG": np.flatnonzero(nodes[:, 2] < near) + 1,
        "AHEAD": np.flatnonzero((nodes[:, 1] < near) & (nodes[:, 0] > CUT - near)) + 1,
        "GRIP": np.flatnonzero(nodes[:, 1] > HALF_HEIGHT - near) + 1,
        "LIP": np.flatnonzero((nodes[:, 1] < near) & (nodes[:, 0] < CUT + near)) + 1,
    }
    text = ["*HEADING", "A quarter of a cut block", "*NODE, NSET=ALL"]
    text += [f"{k + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(nodes)]
    text.append("*ELEMENT, TYPE=C3D20R, ELSET=TISSUE")
    for k, element in enumerate(elements):
        text += [f"{k + 1}, " + ", ".join(map(str, element[:15])) + ",", ", ".join(map(str, element[15:]))]
    for name, members in sets.items():
        text += lines_of(name, members)
    text += ["*MATERIAL, NAME=TISSUE", "*HYPERELASTIC, NEO HOOKE", f"{SHEAR / 2:.12g}, {2 / bulk:.12g}",
             "*SOLID SECTION, ELSET=TISSUE, MATERIAL=TISSUE", "*BOUNDARY", "ALONG, 3, 3", "AHEAD, 2, 2", "GRIP, 1, 1", "GRIP, 3, 3"]
    for stretch in STRETCHES:
        text += ["*STEP, NLGEOM, INC=400", "*STATIC", "0.1, 1.0, 1e-5, 0.2", "*BOUNDARY", f"GRIP, 2, 2, {stretch * HALF_HEIGHT:.12g}",
                 "*NODE PRINT, NSET=LIP, FREQUENCY=1000", "U", "*NODE PRINT, NSET=GRIP, TOTALS=ONLY, FREQUENCY=1000", "RF", "*END STEP"]
    return "\n".join(text) + "\n"


def solve(folder, name, nodes, elements):
    """For every stretch the displacements of the lip's nodes by number, and the force of the grip along y, of a quarter."""
    (folder / f"{name}.inp").write_text(input_text(nodes, elements))
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True,
                          env={**os.environ, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")})
    output = folder / f"{name}.dat"
    if done.returncode != 0 or not output.is_file() or "Job finished" not in done.stdout:
        sys.exit(f"ccx -i {name} ended with {done.returncode}:\n" + "\n".join(done.stdout.splitlines()[-15:]))
    found, time = {}, None
    for line in output.read_text().splitlines():
        heading = re.match(r" (displacements|total force).* time\s+(\S+)", line)
        if heading:
            kind, time = heading[1], round(float(heading[2]), 6)
            found.setdefault(time, {"lip": {}, "force": None})
        elif line.strip():
            values = line.split()
            if kind == "displacements":
                found[time]["lip"][int(values[0])] = [float(v) for v in values[1:]]
            else:
                found[time]["force"] = float(values[1])
    return [found[float(step + 1)] for step in range(len(STRETCHES))]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder, table = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.split()[-1]
    openings, forces, sizes = [], [], []
    x, _, _ = corners(MESHES[0][0])
    places = [(a, z) for z in (0.0, HALF_DEPTH) for a in x if a < CUT - 1e-9]
    for level, (cells, quarter) in enumerate(MESHES):
        nodes, elements = mesh(cells, quarter)
        found = solve(folder, f"gaping_{level}", nodes, elements)
        lookup = {(round(a, 9), round(c, 9)): k + 1 for k, (a, b, c) in enumerate(nodes) if b < 1e-9}
        openings.append([[2 * step["lip"][lookup[round(a, 9), round(z, 9)]][1] for step in found] for a, z in places])
        forces.append([2 * step["force"] for step in found])
        sizes.append((len(elements), len(nodes)))
        print(f"{sizes[-1][0]} elements, {sizes[-1][1]} nodes: openings at the mouth {openings[-1][0]}, forces {forces[-1]}", flush=True)
    coarse, fine = np.array(openings)
    change = np.abs(fine - coarse).max(axis=0) / fine.max(axis=0)
    force_change = np.abs(np.array(forces[1]) / np.array(forces[0]) - 1)
    with table.open("w") as out:
        out.write("# made by: experiments/gaping/reference_calculix.py FOLDER experiments/gaping/reference.csv\n")
        out.write(f"# source: CalculiX {version}, C3D20R, {sizes[0][0]} elements with quarter points and {sizes[1][0]} without ({sizes[0][1]} and {sizes[1][1]} nodes) in a quarter\n")
        for step, stretch in enumerate(STRETCHES):
            percent = round(100 * stretch)
            out.write(f"# force_{percent}: {forces[1][step]:.6g}\n# force_change_{percent}: {force_change[step]:.2g}\n")
            out.write(f"# opening_change_{percent}: {change[step]:.2g}\n")
        out.write("x,z,opening_20,opening_40,coarse_opening_20,coarse_opening_40\n")
        for (a, z), b, c in zip(places, fine, coarse):
            out.write(f"{a:.9g},{z:.9g},{b[0]:.8g},{b[1]:.8g},{c[0]:.8g},{c[1]:.8g}\n")


if __name__ == "__main__":
    main()
