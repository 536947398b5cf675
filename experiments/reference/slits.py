#!/usr/bin/env python3
"""Makes the stored tables of the experiments `precut_kinked` and `precut_crossing` with two finite element codes.

slits.py CASE FOLDER FILE     CASE is kinked or crossing; works in FOLDER and writes FILE, the table

A square plate in plane strain, 2 m wide about the origin, E = 1 Pa, nu = 0.3, with slits that are polylines, pulled on its four sides by
constant tractions normal to them. Both codes take triangulations that become finer towards the ends, corners and crossings of the
slits in geometric steps, two of them each:

    CalculiX (Debian's calculix-ccx)    each triangle divided into three quadrilaterals of eight nodes, CPE8
    GetFEM (Debian's python3-getfem)    the triangles themselves, cubic

Needs numpy and scipy. No element has special functions at the ends.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import getfem
import numpy as np
from scipy.spatial import Delaunay

HALF, RATIO = 1.0, 0.3
# Slits by their corners; those of a slit at which it crosses another are corners, too. Tractions of the sides x = +-1, y = +-1.
ROOT = np.sqrt(0.5)
CASES = {
    "kinked": ([[(-0.45, -0.1), (0.15, -0.1), (0.15 + 0.35 * ROOT, -0.1 + 0.35 * ROOT)]], (0.0, 1.0)),
    "crossing": ([[(-0.5, 0.05), (0.1, 0.05), (0.45, 0.05)],
                  [(0.1 - 0.25 * 0.5, 0.05 - 0.25 * np.sqrt(0.75)), (0.1, 0.05), (0.1 + 0.4 * 0.5, 0.05 + 0.4 * np.sqrt(0.75))]],
                 (1.0, 1.0)),
}
# Places of a straight part of a slit where openings are compared, of its length.
PLACES = np.array([0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9])
# Longest edges far away, and at the ends of slits; edges grow with this share of the distance from there.
MESHES = ((0.12, 4e-3, 0.4), (0.07, 5e-4, 0.25))


class Mesh:
    """Triangles about the slits, whose parts are edges: `on_slit` has slit and part of each."""

    def __init__(self, slits):
        self.points, self.on_slit, self.places = [], {}, []
        number = {}

        def add(x):
            key = (round(x[0], 10), round(x[1], 10))
            if key not in number:
                number[key] = len(self.points)
                self.points.append(np.array(x, float))
            return number[key]

        for s, slit in enumerate(slits):
            for p, (a, b) in enumerate(zip(slit[:-1], slit[1:])):
                a, b = np.array(a), np.array(b)
                along = (b - a) / np.linalg.norm(b - a)
                last = add(a)
                for share in [*PLACES, 1.0]:
                    here = add(a + share * (b - a))
                    self.on_slit[tuple(sorted((last, here)))] = (s, p)
                    last = here
                self.places += [(s, p, share, add(a + share * (b - a)), np.array([-along[1], along[0]])) for share in PLACES]
        singular = [np.array(x) for slit in slits for x in slit]
        self.singular = np.unique(np.round(singular, 10), axis=0)
        grid = np.linspace(-HALF, HALF, 17)
        for x in grid:
            for y in grid:
                if self.free_of_slits(np.array([x, y])):
                    add((x, y))
        self.points = np.array(self.points)
        self.triangles = [tuple(t) for t in Delaunay(self.points).simplices]
        edges = {tuple(sorted((t[k], t[(k + 1) % 3]))) for t in self.triangles for k in range(3)}
        if not set(self.on_slit) <= edges:
            sys.exit("a slit is no chain of edges of the first triangulation")

    def free_of_slits(self, x):
        """Whether x lies outside the circles over the edges of the slits, which are then edges of the triangulation."""
        return all(np.linalg.norm(x - 0.5 * (self.points[a] + self.points[b])) > 0.6 * np.linalg.norm(self.points[a] - self.points[b])
                   for a, b in self.on_slit)

    def refine(self, far, near, share):
        """Bisects longest edges until none is longer than what is wanted there."""
        points = list(self.points)

        def wanted(x):
            return min(far, max(near, share * np.linalg.norm(self.singular - x, axis=1).min()))

        def longest(t):
            edges = [tuple(sorted((t[k], t[(k + 1) % 3]))) for k in range(3)]
            return max(edges, key=lambda e: (round(np.linalg.norm(points[e[0]] - points[e[1]]), 12), e))

        def bisect(t):
            """The triangles that t becomes when its marked edges are bisected, the longest first."""
            if not any(tuple(sorted((t[k], t[(k + 1) % 3]))) in middle for k in range(3)):
                return [t]
            edge = longest(t) if longest(t) in middle else next(e for e in (tuple(sorted((t[k], t[(k + 1) % 3]))) for k in range(3)) if e in middle)
            k = next(k for k in range(3) if t[k] not in edge)
            apex, a, b = t[k], t[(k + 1) % 3], t[(k + 2) % 3]
            return bisect((apex, a, middle[edge])) + bisect((apex, middle[edge], b))

        while True:
            marked = set()
            for t in self.triangles:
                edge = longest(t)
                if np.linalg.norm(points[edge[0]] - points[edge[1]]) > wanted(sum(points[v] for v in t) / 3):
                    marked.add(edge)
            if not marked:
                break
            grown = True
            while grown:  # a triangle with a marked edge has its longest edge marked
                grown = False
                for t in self.triangles:
                    if longest(t) not in marked and any(tuple(sorted((t[k], t[(k + 1) % 3]))) in marked for k in range(3)):
                        marked.add(longest(t))
                        grown = True
            middle = {}
            for edge in sorted(marked):
                middle[edge] = len(points)
                points.append(0.5 * (points[edge[0]] + points[edge[1]]))
                if edge in self.on_slit:
                    part = self.on_slit.pop(edge)
                    for end in edge:
                        self.on_slit[tuple(sorted((end, middle[edge])))] = part
            self.triangles = [child for t in self.triangles for child in bisect(t)]
        self.points = np.array(points)

    def open_slits(self):
        """Gives the faces of the slits vertices of their own. Returns for each place the two on its left and right."""
        around = {}
        for index, t in enumerate(self.triangles):
            for v in t:
                around.setdefault(v, []).append(index)
        points, triangles = list(self.points), [list(t) for t in self.triangles]
        copies, faces = {}, set()
        for v in sorted({v for edge in self.on_slit for v in edge}):
            left = set(around[v])
            fans = []
            while left:
                fan, todo = set(), [left.pop()]
                while todo:
                    index = todo.pop()
                    fan.add(index)
                    for other in list(left):
                        shared = set(self.triangles[index]) & set(self.triangles[other])
                        if len(shared) == 2 and tuple(sorted(shared)) not in self.on_slit:
                            left.discard(other)
                            todo.append(other)
                fans.append(fan)
            for k, fan in enumerate(fans):
                copy = v if k == 0 else len(points)
                if k > 0:
                    points.append(self.points[v])
                copies.setdefault(v, []).append((copy, np.mean([self.points[list(self.triangles[i])].mean(axis=0) for i in fan], axis=0)))
                faces.add(copy)
                for index in fan:
                    triangles[index] = [copy if w == v else w for w in triangles[index]]
        pairs = []
        for _, _, _, v, normal in self.places:
            sides = sorted(copies[v], key=lambda c: -normal @ (c[1] - self.points[v]))
            if len(sides) != 2:
                sys.exit("a place of a slit has not two faces")
            pairs.append((sides[0][0], sides[1][0]))
        points = np.array(points)
        for t in triangles:  # all turn the same way
            a, b, c = points[t]
            if np.cross(b - a, c - a) < 0:
                t[1], t[2] = t[2], t[1]
        return points, np.array(triangles), pairs


def corner(points, x, y):
    return int(np.argmin(np.linalg.norm(points - np.array([x, y]), axis=1)))


def by_calculix(folder, name, points, triangles, tension):
    """Displacements of the vertices; number of elements."""
    nodes, number, quads = [tuple(p) for p in points], {}, []

    def node(key, x):
        if key not in number:
            number[key] = len(nodes)
            nodes.append(tuple(x))
        return number[key]

    def between(a, b):
        return node((min(a, b), max(a, b)), 0.5 * (np.array(nodes[a]) + np.array(nodes[b])))

    for index, t in enumerate(triangles):
        centre = node(("centre", index), points[t].mean(axis=0))
        for k in range(3):
            ring = [t[k], between(t[k], t[(k + 1) % 3]), centre, between(t[(k + 2) % 3], t[k])]
            quads.append(ring + [between(ring[m], ring[(m + 1) % 4]) for m in range(4)])
    forces = {}
    for quad in quads:
        for m in range(4):
            ends = np.array([nodes[quad[m]], nodes[quad[(m + 1) % 4]]])
            for axis in range(2):
                if np.all(np.abs(np.abs(ends[:, axis]) - HALF) < 1e-9) and ends[0, axis] * ends[1, axis] > 0:
                    whole = np.sign(ends[0, axis]) * tension[axis] * np.linalg.norm(ends[1] - ends[0])
                    for n, part in ((quad[m], 1 / 6), (quad[(m + 1) % 4], 1 / 6), (quad[4 + m], 2 / 3)):
                        forces[n, axis] = forces.get((n, axis), 0) + part * whole
    text = ["*HEADING", f"A plate with slits, {name}", "*NODE, NSET=ALL"]
    text += [f"{k + 1}, {x:.12g}, {y:.12g}, 0" for k, (x, y) in enumerate(nodes)]
    text += ["*ELEMENT, TYPE=CPE8, ELSET=PLATE"] + [f"{k + 1}, " + ", ".join(str(n + 1) for n in quad) for k, quad in enumerate(quads)]
    text += ["*NSET, NSET=VERTICES, GENERATE", f"1, {len(points)}, 1",
             "*MATERIAL, NAME=TISSUE", "*ELASTIC", f"1, {RATIO}", "*SOLID SECTION, ELSET=PLATE, MATERIAL=TISSUE", "1", "*BOUNDARY",
             f"{corner(points, -HALF, -HALF) + 1}, 1, 2", f"{corner(points, HALF, -HALF) + 1}, 2, 2", "*STEP", "*STATIC", "*CLOAD"]
    text += [f"{n + 1}, {axis + 1}, {force:.12g}" for (n, axis), force in sorted(forces.items()) if force != 0]
    text += ["*NODE PRINT, NSET=VERTICES", "U", "*END STEP"]
    (folder / f"{name}.inp").write_text("\n".join(text) + "\n")
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True,
                          env={**os.environ, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")})
    output = folder / f"{name}.dat"
    if done.returncode != 0 or not output.is_file() or "Job finished" not in done.stdout:
        sys.exit(f"ccx -i {name} ended with {done.returncode}:\n" + "\n".join(done.stdout.splitlines()[-15:]))
    found = np.full((len(points), 2), np.nan)
    for line in output.read_text().splitlines():
        if re.match(r"\s+\d+(\s+\S+){3}$", line):
            values = line.split()
            found[int(values[0]) - 1] = [float(values[1]), float(values[2])]
    return found, len(quads)


def by_getfem(points, triangles, tension):
    """Displacements of the vertices; number of elements."""
    # GetFEM joins points at one place: those of the faces of a slit go apart by a little, each into its own triangles.
    apart, count = np.zeros_like(points), np.zeros(len(points))
    for t in triangles:
        apart[t] += points[t].mean(axis=0) - points[t]
        count[t] += 1
    places, times = np.unique(np.round(points, 10), axis=0, return_counts=True)
    several = {tuple(p) for p, n in zip(places, times) if n > 1}
    moved = np.array([p + (1e-5 * a / n if tuple(np.round(p, 10)) in several else 0) for p, a, n in zip(points, apart, count)])
    getfem.util_trace_level(1)
    mesh = getfem.Mesh("empty", 2)
    mesh.add_convex(getfem.GeoTrans("GT_PK(2,1)"), np.stack([moved[triangles[:, k]].T for k in range(3)], axis=1))
    if mesh.nbpts() != len(points):
        sys.exit(f"GetFEM has joined {len(points) - mesh.nbpts()} points")
    fem = getfem.MeshFem(mesh, 2)
    fem.set_fem(getfem.Fem("FEM_PK(2,3)"))
    rule = getfem.MeshIm(mesh, getfem.Integ("IM_TRIANGLE(6)"))
    model = getfem.Model("real")
    model.add_fem_variable("u", fem)
    model.add_initialized_data("lambda", RATIO / ((1 + RATIO) * (1 - 2 * RATIO)))
    model.add_initialized_data("mu", 1 / (2 * (1 + RATIO)))
    model.add_isotropic_linearized_elasticity_brick(rule, "u", "lambda", "mu")
    outer = mesh.outer_faces()
    normals = mesh.normal_of_faces(outer)
    middles = np.array([mesh.pts_from_cvid(c)[0][:, [k for k in range(3) if k != f]].mean(axis=1) for c, f in outer.T])
    for region, (axis, side) in enumerate([(0, -1), (0, 1), (1, -1), (1, 1)], 1):
        on = np.abs(middles[:, axis] - side * HALF) < 1e-6
        if not np.allclose(normals[axis, on], side):
            sys.exit("faces of the plate's side look elsewhere")
        mesh.set_region(region, outer[:, on])
        pull = [0.0, 0.0]
        pull[axis] = side * tension[axis]
        model.add_initialized_data(f"pull{region}", pull)
        model.add_source_term_brick(rule, "u", f"pull{region}", region)
    held = np.array([[-HALF, -HALF, HALF], [-HALF, -HALF, -HALF]])
    model.add_initialized_data("at", held.T.flatten())
    model.add_initialized_data("along", np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]).flatten())
    model.add_pointwise_constraints_with_multipliers("u", "at", "along")
    model.solve()
    found = np.full((len(points), 2), np.nan)
    values = model.variable("u").reshape(-1, 2)
    where = fem.basic_dof_nodes()[:, ::2].T
    lookup = {tuple(np.round(x, 9)): v for x, v in zip(where, values)}
    for k, x in enumerate(moved):
        found[k] = lookup[tuple(np.round(x, 9))]
    return found, len(triangles)


def main():
    if len(sys.argv) != 4 or sys.argv[1] not in CASES:
        sys.exit(__doc__)
    case, folder, table = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.split()[-1]
    slits, tension = CASES[case]
    openings, sizes = {"calculix": [], "getfem": []}, {"calculix": [], "getfem": []}
    for level, steps in enumerate(MESHES):
        mesh = Mesh(slits)
        mesh.refine(*steps)
        points, triangles, pairs = mesh.open_slits()
        for code, (u, elements) in (("calculix", by_calculix(folder, f"{case}_{level}", points, triangles, tension)),
                                    ("getfem", by_getfem(points, triangles, tension))):
            openings[code].append(np.array([u[a] - u[b] for a, b in pairs]))
            sizes[code].append(elements)
            print(f"{code}: {elements} elements, largest opening {np.linalg.norm(openings[code][-1], axis=1).max():.6g}", flush=True)
    largest = np.linalg.norm(openings["calculix"][1], axis=1).max()

    def apart(a, b):
        return np.linalg.norm(a - b, axis=1).max() / largest

    normal = np.array([u @ place[4] for u, place in zip(openings["calculix"][1], mesh.places)])
    if normal.min() <= 0:
        sys.exit(f"faces of a slit overlap by {-normal.min():.3g}")
    with table.open("w") as out:
        out.write(f"# made by: experiments/reference/slits.py {case} FOLDER experiments/precut_{case}/reference.csv\n")
        out.write(f"# source: CalculiX {version}, CPE8, {sizes['calculix'][0]} and {sizes['calculix'][1]} elements; "
                  f"GetFEM {getfem.getfem_env('version')}, cubic triangles, {sizes['getfem'][0]} and {sizes['getfem'][1]} elements\n")
        out.write(f"# tension: {tension[0]:g} {tension[1]:g}\n# poisson_ratio: {RATIO:g}\n")
        for s, slit in enumerate(slits):
            out.write(f"# slit_{s}: " + " ".join(f"{c:.12g}" for x in slit for c in x) + "\n")
        out.write(f"# calculix_change: {apart(*openings['calculix']):.2g}\n# getfem_change: {apart(*openings['getfem']):.2g}\n")
        out.write(f"# codes_apart: {apart(openings['calculix'][1], openings['getfem'][1]):.2g}\n")
        out.write("slit,part,share,calculix_x,calculix_y,getfem_x,getfem_y\n")
        for (s, p, share, _, _), a, b in zip(mesh.places, openings["calculix"][1], openings["getfem"][1]):
            out.write(f"{s},{p},{share:g},{a[0]:.7g},{a[1]:.7g},{b[0]:.7g},{b[1]:.7g}\n")


if __name__ == "__main__":
    main()
