#!/usr/bin/env python3
"""Writes what follows from the formulas of the cases: points and exact values into case.json, body.obj and cut.obj beside it.

derive.py [CASE...]
"""

import json
import math
import re
import sys
from pathlib import Path

import numpy as np
from cutbench import CASES, chosen_cases, evaluate, names_of, run_main

CELLS = 8  # of the surfaces' grids across


def rounded(value):
    return float(f"{value:.12g}")


def points_of(quantity, case):
    at = quantity["at"]
    names = names_of(case)
    if isinstance(at, dict):
        # Half a step off the axes, so that no place is a special one.
        turns = [2 * math.pi * (k + 0.5) / at["count"] for k in range(at["count"])]
        return [[rounded(evaluate(at[axis], {**names, "t": t})) for axis in "xyz"] for t in turns]
    return [[rounded(evaluate(formula, names)) for formula in point] for point in at]


def with_values(case):
    for quantity in case["quantities"]:
        points = points_of(quantity, case) if "at" in quantity else [None]
        if points[0] is not None:
            quantity["points"] = points
        quantity["values"] = [rounded(evaluate(quantity["formula"], names_of(case, point))) for point in points]
        largest = max(map(abs, quantity["values"]))
        quantity["scale_value"] = rounded(evaluate(quantity["scale"], names_of(case))) if "scale" in quantity else largest
    return case


def grid_surface(place, cells):
    """Vertices and triangles of a grid over the square [-1, 1]^2."""
    steps = np.linspace(-1, 1, cells + 1)
    vertices = [place(u, v) for v in steps for u in steps]
    triangles = []
    for j in range(cells):
        for i in range(cells):
            k = j * (cells + 1) + i
            triangles += [(k, k + 1, k + cells + 2), (k, k + cells + 2, k + cells + 1)]
    return vertices, triangles


def axes_of(normal):
    """Two directions that make a right-handed frame with a normal along a coordinate axis."""
    k = int(np.argmax(np.abs(normal)))
    return np.eye(3)[(k + 1) % 3], np.eye(3)[(k + 2) % 3]


def cut_surface(cut):
    """Counter-clockwise from the + side, to which the normal points. A cut reaches out of the body where it may."""
    centre, normal = np.array(cut["centre"], float), np.array(cut["normal"], float)
    first, second = axes_of(normal)
    if cut["shape"] == "rectangle":
        half = 0.5 * np.array(cut["lengths"])
        return grid_surface(lambda u, v: centre + u * half[0] * first + v * half[1] * second, CELLS)
    half = cut["half_axes"] if cut["shape"] == "ellipse" else [cut["radius"]] * 2
    angle = math.radians(cut.get("half_angle_degrees", 0))
    # Rings about the middle, with as many corners each.
    rings, corners = 3 * CELLS if angle else CELLS, 20 * CELLS
    vertices, triangles = [], []
    for i in range(rings + 1):
        share = i / rings
        radius = math.sin(share * angle) / math.sin(angle) if angle else share
        height = (math.cos(share * angle) - math.cos(angle)) / math.sin(angle) * half[0] if angle else 0.0
        for j in range(corners if i else 1):
            turn = 2 * math.pi * j / corners
            vertices.append(centre + radius * (half[0] * math.cos(turn) * first + half[1] * math.sin(turn) * second) + height * normal)
    for j in range(corners):
        k = (j + 1) % corners
        triangles.append((0, 1 + j, 1 + k))
        for i in range(1, rings):
            inner, outer = 1 + (i - 1) * corners, 1 + i * corners
            triangles += [(inner + j, outer + j, outer + k), (inner + j, outer + k, inner + k)]
    return vertices, triangles


def body_surface(body):
    """The six faces of a box with common vertices, outward."""
    lower, upper = np.array(body["lower"], float), np.array(body["upper"], float)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    vertices, triangles, number = [], [], {}
    for axis in range(3):
        first, second = axes_of(np.eye(3)[axis])
        for side in (-1, 1):
            points, faces = grid_surface(lambda u, v: side * np.eye(3)[axis] + u * first + v * second, CELLS)
            index = []
            for point in points:
                key = tuple(np.round(point, 9) + 0.0)
                if key not in number:
                    number[key] = len(vertices)
                    vertices.append(middle + half * point)
                index.append(number[key])
            triangles += [tuple(index[k] for k in (face if side > 0 else face[::-1])) for face in faces]
    return vertices, triangles


def write_obj(file, surface):
    vertices, triangles = surface
    lines = ["v " + " ".join(f"{value + 0.0:.8g}" for value in vertex) for vertex in vertices]
    lines += ["f " + " ".join(str(k + 1) for k in triangle) for triangle in triangles]
    file.write_text("\n".join(lines) + "\n")


def text_of(case):
    """JSON with a line for each list of plain values."""
    text = json.dumps(case, indent=1)
    return re.sub(r"\[[^\[\]{}]*\]", lambda found: re.sub(r"\s+", " ", found[0]).replace("[ ", "[").replace(" ]", "]"), text) + "\n"


def main():
    for case in chosen_cases(sys.argv[1:]):
        folder: Path = CASES / case["name"]
        (folder / "case.json").write_text(text_of(with_values(case)))
        write_obj(folder / "body.obj", body_surface(case["body"]))
        if "cut" in case:
            write_obj(folder / "cut.obj", cut_surface(case["cut"]))


if __name__ == "__main__":
    run_main(main)
