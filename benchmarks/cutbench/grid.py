"""A box of hexahedra whose nodes are doubled on a plane cut, made for the cases that such a mesh can hold."""

import itertools
from dataclasses import dataclass, field

import numpy as np
from cutbench import BadInput, relieved_stress, vector

# Corners of an element in the order of Abaqus and VTK, in halves of it; edges by their corners.
CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
PLACES = CORNERS + [tuple((CORNERS[i][k] + CORNERS[j][k]) // 2 for k in range(3)) for i, j in EDGES]


@dataclass
class Grid:
    """Nodes are numbered from 0. Faces are those of elements, as 8 or 4 numbers of nodes, with their normals out of the tissue."""

    nodes: np.ndarray  # (n, 3), m
    elements: np.ndarray  # (m, 20) or (m, 8)
    face_nodes: dict = field(default_factory=dict)  # "-x" .. "+z": numbers of the nodes on that face
    faces: dict = field(default_factory=dict)  # "-x" .. "+z", "cut+", "cut-": faces of elements
    pairs: np.ndarray = None  # (k, 2): nodes at the same place on the + and the - side of the cut


def graded(start, end, count, ratio):
    """Places from start to end; the last cell is `ratio` times as long as the first."""
    steps = ratio ** (np.arange(count) / max(1, count - 1))
    return start + (end - start) * np.concatenate([[0], np.cumsum(steps)]) / steps.sum()


def both_ways(lower, at, upper, below, above):
    """Places through `at`, finest there; `below` and `above` are the cells of either side and the ratio of their lengths."""
    down = graded(at, lower, *below)[::-1] if at > lower else np.array([at])
    up = graded(at, upper, *above) if at < upper else np.array([at])
    return np.concatenate([down[:-1], up])


def across_cut(lower, first, last, upper, inside, outside):
    """Places of a line that the borders first < last of a cut divide, finest at those within the body."""
    start, end = max(first, lower), min(last, upper)
    middle = 0.5 * (start + end)
    low = both_ways(lower, first, middle, outside, inside) if first > lower else graded(lower, middle, inside[0], 1)
    high = both_ways(middle, last, upper, inside, outside) if last < upper else graded(middle, upper, inside[0], 1)
    return np.concatenate([low, high[1:]])


def with_middles(places):
    return np.sort(np.concatenate([places, 0.5 * (places[1:] + places[:-1])]))


def round_map(half_axes, body):
    """Takes the square of edge 2 to the cut's ellipse and what is around it to the body's rectangle."""
    half = 0.5 * (np.array(body["upper"][:2]) - np.array(body["lower"][:2]))
    reach = half / half_axes
    def place(u, v):
        rho = max(abs(u), abs(v))
        if rho == 0:
            return np.zeros(2)
        square = np.array([u, v]) / rho
        circle = square / np.linalg.norm(square)
        if rho <= 1:
            return rho * ((1 - rho) * 0.8 * square + rho * circle) * half_axes
        share = (rho - 1) / (reach.min() - 1)
        return (1 - share) * rho * circle * half_axes + share * rho / reach.min() * square * half
    return place, reach.min()


def make_grid(case, order, refine=1):
    """The grid of a case: order 1 for 8 nodes an element, 2 for 20. `refine` multiplies the cells a line."""
    body, cut, tool = case["body"], case.get("cut"), case.get("tool")
    lower, upper = np.array(body["lower"], float), np.array(body["upper"], float)
    if (cut and cut["shape"] == "cap") or (tool and tool["shape"] == "ball"):
        raise BadInput(f"case '{case['name']}': its {'cut' if cut else 'tool'} has no grid of hexahedra here; allowed: plane cuts, flat punches")
    lines, place = None, None
    normal = int(np.argmax(np.abs(cut["normal"]))) if cut else 2
    if (cut and cut["shape"] in ("disc", "ellipse")) or tool:
        half_axes = np.array(cut.get("half_axes") or [cut["radius"]] * 2 if cut else [tool["radius"]] * 2, float)
        place, reach = round_map(half_axes, body)
        line = across_cut(-reach, -1, 1, reach, (4 * refine, 8), (6 * refine, 70))
        centre = cut["centre"][2] if cut else 0.0
        lines = [line, line, both_ways(lower[2], centre, upper[2], *[(7 * refine, 100)] * 2)]
        def inside(u, v):
            return max(abs(u), abs(v)) < 1 - 1e-9
    elif cut:
        centre = np.array(cut["centre"], float)
        first, second = (normal + 1) % 3, (normal + 2) % 3
        lines = [None] * 3
        border = {}
        through = any(length > (upper - lower)[axis] for axis, length in zip((first, second), cut["lengths"]))
        cells = (6 if through else 3) * refine
        for axis, length in zip((first, second), cut["lengths"]):
            border[axis] = (centre[axis] - 0.5 * length, centre[axis] + 0.5 * length)
            lines[axis] = np.linspace(lower[axis], upper[axis], 2 * refine + 1) if length > (upper - lower)[axis] else \
                across_cut(lower[axis], *border[axis], upper[axis], *[(cells, 12)] * 2)
        lines[normal] = both_ways(lower[normal], centre[normal], upper[normal], *[(cells * 3 // 2, 50)] * 2)
        def inside(u, v):
            return all(border[axis][0] + 1e-9 * (upper - lower)[axis] < value < border[axis][1] - 1e-9 * (upper - lower)[axis]
                       for axis, value in zip((first, second), (u, v)))
    else:
        lines = [np.linspace(lower[axis], upper[axis], 3 * refine + 1) for axis in range(3)]
        def inside(u, v):
            return False
    lines = [with_middles(line) for line in lines]
    return numbered(lines, place, normal, cut, tool, inside, order)


def numbered(lines, place, normal, cut, tool, inside, order):
    """Numbers the nodes that elements have, doubled inside the cut: the + side has those of its own."""
    first, second = (normal + 1) % 3, (normal + 2) % 3
    cut_line = int(np.argmin(np.abs(lines[normal] - cut["centre"][normal]))) if cut else -1
    count = [(len(line) - 1) // 2 for line in lines]
    number, nodes, elements, pairs = {}, [], [], []

    def in_cut(index):
        return cut is not None and index[normal] == cut_line and inside(lines[first][index[first]], lines[second][index[second]])

    def node(index, above):
        key = (*index, above and in_cut(index))
        if key not in number:
            number[key] = len(nodes)
            point = np.array([lines[axis][index[axis]] for axis in range(3)])
            if place:
                point[:2] = place(point[0], point[1])
            nodes.append(point)
        return number[key]

    names = {axis: ("-" + "xyz"[axis], "+" + "xyz"[axis]) for axis in range(3)}
    faces = {name: [] for pair in names.values() for name in pair}
    faces.update({"cut+": [], "cut-": [], "tool": []})
    on_face = {name: set() for name in faces}
    places = PLACES if order == 2 else CORNERS
    for cell in itertools.product(*(range(n) for n in count)):
        above = 2 * cell[normal] >= cut_line
        element = [node(tuple(2 * cell[k] + p[k] for k in range(3)), above) for p in places]
        elements.append(element)
        for axis in range(3):
            for side in (0, 1):
                face = [element[k] for k in face_places(axis, side, order)]
                if (side == 0 and cell[axis] == 0) or (side == 1 and cell[axis] == count[axis] - 1):
                    faces[names[axis][side]].append(face)
                    on_face[names[axis][side]].update(face)
                middle = [2 * c + 1 for c in cell]
                middle[axis] = 2 * (cell[axis] + side)
                if axis == normal and in_cut(middle):
                    faces["cut+" if side == 0 else "cut-"].append(face)
    for key, k in number.items():
        if key[3]:
            pairs.append((k, number[(*key[:3], False)]))
    grid = Grid(np.array(nodes), np.array(elements), {name: sorted(members) for name, members in on_face.items()},
                {name: np.array(members) for name, members in faces.items() if members}, np.array(pairs, int).reshape(-1, 2))
    if tool:
        at = np.array(tool["at"], float)
        near = np.linalg.norm(grid.nodes - at, axis=1) <= tool["radius"] * (1 + 1e-9)
        grid.face_nodes["tool"] = [k for k in grid.face_nodes["+z"] if near[k]]
    return grid


def face_places(axis, side, order):
    """Corners of a face, counter-clockwise seen from outside, then the middles of its edges in the same order."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    ring = [(0, 0), (2, 0), (2, 2), (0, 2)]
    ring = ring if side else ring[::-1]
    if order == 2:
        ring = ring + [tuple((ring[k][i] + ring[(k + 1) % 4][i]) // 2 for i in range(2)) for k in range(4)]
    found = []
    for a, b in ring:
        at = [0, 0, 0]
        at[axis], at[first], at[second] = 2 * side, a, b
        found.append(PLACES.index(tuple(at)))
    return found


def face_shapes(order, r, s):
    """Shape functions of a face of 4 or 8 nodes at r, s in [-1, 1], and their two slopes."""
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    a, b = 1 + corner[:, 0] * r, 1 + corner[:, 1] * s
    if order == 1:
        return a * b / 4, np.stack([corner[:, 0] * b, a * corner[:, 1]]) / 4
    t = corner[:, 0] * r + corner[:, 1] * s - 1
    shape = np.concatenate([a * b * t / 4, [(1 - r * r) * (1 - s) / 2, (1 + r) * (1 - s * s) / 2, (1 - r * r) * (1 + s) / 2, (1 - r) * (1 - s * s) / 2]])
    by_r = np.concatenate([corner[:, 0] * b * (t + a) / 4, [-r * (1 - s), (1 - s * s) / 2, -r * (1 + s), -(1 - s * s) / 2]])
    by_s = np.concatenate([corner[:, 1] * a * (t + b) / 4, [-(1 - r * r) / 2, -s * (1 + r), (1 - r * r) / 2, -s * (1 - r)]])
    return shape, np.stack([by_r, by_s])


def nodal_forces(grid, order, faces, traction):
    """(n, 3), N: work-equivalent to traction(x, normal), Pa, on faces."""
    forces = np.zeros_like(grid.nodes)
    places, weights = np.polynomial.legendre.leggauss(3)
    for face in faces:
        x = grid.nodes[face]
        for i, j in itertools.product(range(3), repeat=2):
            shape, slope = face_shapes(order, places[i], places[j])
            across = np.cross(*(slope @ x))
            size = np.linalg.norm(across)
            forces[face] += weights[i] * weights[j] * size * np.outer(shape, traction(shape @ x, across / size))
    return forces


def case_forces(case, grid, order):
    """(n, 3), N: of the stress that the cut takes away and of tractions on the body's faces."""
    forces = np.zeros_like(grid.nodes)
    if "relieves" in case:
        for side in ("cut+", "cut-"):
            forces += nodal_forces(grid, order, grid.faces[side], lambda x, n: -np.array(relieved_stress(case, x)) @ n)
    for load in case.get("tractions", []):
        forces += nodal_forces(grid, order, grid.faces[load["where"]], lambda x, n, load=load: np.array(vector(load["traction"], case, x)))
    return forces


def given_displacements(case, grid):
    """{(node, axis): m} of all supports and of a flat punch; where several hold an axis of a node the first counts."""
    given = {}
    for support in case["supports"]:
        where = support["where"]
        if where == "surface":
            members = sorted(set().union(*(grid.face_nodes[name] for name in ("-x", "+x", "-y", "+y", "-z", "+z"))))
        elif isinstance(where, str):
            members = grid.face_nodes[where]
        else:
            members = [int(np.argmin(np.linalg.norm(grid.nodes - where, axis=1)))]
        for node in members:
            values = vector(support["displacement"], case, grid.nodes[node])
            for axis, value in zip(support["axes"], values):
                given.setdefault((node, "xyz".index(axis)), value)
    for node in grid.face_nodes.get("tool", []):
        given.setdefault((node, 2), -case["tool"]["depth"])
    return given
