#!/usr/bin/env python3
"""Computes cases with the Python package of Spherecut and writes a result file.

run_spherecut.py --out FILE [--seeds N] [--coarse] [CASE...]

Every value is the median over the node sets.
"""

import argparse
from pathlib import Path

import numpy as np
from cutbench import CASES, BadInput, chosen_cases, error_of, moduli_of, relieved_stress, run_main, vector, write_result

import spherecut as sc

# Nodes at the front, of the smallest half axis of the cut; away from it the distance grows by 0.3 m per m.
FRONT_SHARE = {"disc": 0.085, "cap": 0.07, "ellipse": 0.15, "rectangle": 0.09}
TIP_SHARE = {"flat_punch": 0.09, "ball": 0.17}  # of the radius of a tool's contact
BULK_SHARE = 0.12  # of the shortest edge of a body without front or tool


def front_size(cut):
    return min(cut.get("half_axes") or ([cut["radius"]] if "radius" in cut else [0.5 * min(cut["lengths"])]))


def face_of(where, body):
    """Axis, side and coordinate of a face such as '-x'."""
    axis, side = "xyz".index(where[1]), 1 if where[0] == "+" else -1
    return axis, side, body["upper" if side > 0 else "lower"][axis]


def region_of(where, body, spacing):
    if where == "surface":
        return sc.Region.box(np.array(body["lower"]) - 1, np.array(body["upper"]) + 1)
    if not isinstance(where, str):
        return sc.Region.sphere(where, 0.3 * spacing)
    axis, side, coordinate = face_of(where, body)
    point, normal = np.zeros(3), np.zeros(3)
    point[axis], normal[axis] = coordinate, -side
    return sc.Region.half_space(point, normal)


def held_of(case, spacing):
    held = []
    for support in case["supports"]:
        axes = ["xyz".index(letter) for letter in support["axes"]]
        formulas = ["0", "0", "0"]
        for axis, formula in zip(axes, support["displacement"]):
            formulas[axis] = formula
        plain = all(formula == "0" for formula in formulas)
        displacement = None if plain else (lambda x, formulas=formulas: vector(formulas, case, x))
        held.append(sc.Held(region_of(support["where"], case["body"], spacing), [axis in axes for axis in range(3)], displacement))
    return held


def traction_of(case):
    given = case.get("tractions", [])
    if not given:
        return None

    def traction(x, normal):
        for load in given:
            axis, side, _ = face_of(load["where"], case["body"])
            if side * normal[axis] > 0.9:
                return vector(load["traction"], case, x)
        return [0.0, 0.0, 0.0]

    return traction


def contact_radius(tool):
    return tool["radius"] if tool["shape"] == "flat_punch" else (tool["radius"] * tool["depth"]) ** 0.5


def spacing_of(case, incision, coarser):
    """Spacing of the nodes, the finest distance, and nodes that stand where they are put."""
    lower, upper = (np.array(case["body"][k]) for k in ("lower", "upper"))
    points = [support["where"] for support in case["supports"] if not isinstance(support["where"], str)]
    if "tool" in case:
        radius, at = contact_radius(case["tool"]), np.array(case["tool"]["at"], float)
        fine = coarser * TIP_SHARE[case["tool"]["shape"]] * radius
        if case["tool"]["shape"] != "flat_punch":
            return sc.Spacing(fine, 10 * radius, 0.35, radius, centres=[at]), fine, [at]
        # Fine along the punch's edge, with nodes just under it and just beside it.
        turns = np.linspace(0, 2 * np.pi, 65)
        ring = at + radius * np.stack([np.cos(turns), np.sin(turns), 0 * turns], 1)
        count = int(2 * np.pi * radius / fine)
        turns = 2 * np.pi * np.arange(count) / count
        round_it = np.stack([np.cos(turns), np.sin(turns), 0 * turns], 1)
        seeds = [*(at + (radius - 0.5 * fine) * round_it), *(at + (radius + 0.5 * fine) * round_it)]
        return sc.Spacing(fine, 10 * radius, 0.35, segments=np.stack([ring[:-1], ring[1:]], 1)), fine, seeds
    if incision is None or not len(incision.front):
        fine = coarser * BULK_SHARE * (upper - lower).min()
        return sc.Spacing(fine), fine, points
    fine = coarser * FRONT_SHARE[case["cut"]["shape"]] * front_size(case["cut"])
    segments = sc.front_segments(incision, 0.1 * np.linalg.norm(upper - lower))
    return sc.Spacing(fine, 25 * fine, 0.3, segments=segments), fine, points


def press(case, body, fine):
    tool, nodes = case["tool"], body.nodes
    radius, at = contact_radius(tool), np.array(tool["at"], float)
    x = nodes.positions
    reach = radius if tool["shape"] == "flat_punch" else 1.3 * radius + fine
    near = nodes.on_surface() & (np.linalg.norm(x - at, axis=1) < reach)
    shape = sc.Tool.flat_punch(radius) if tool["shape"] == "flat_punch" else sc.Tool.sphere_tip(tool["radius"])
    state = sc.press(sc.condense(body, np.flatnonzero(near)), shape, shape.pose_at(at - [0, 0, tool["depth"]]))
    if not state.converged:
        raise ArithmeticError(f"{case['name']}: the contact was not found")
    return float(state.force[2])


def compute(case, seed, coarser):
    """Values by quantity, and the number of nodes."""
    body = case["body"]
    lower, upper = np.array(body["lower"], float), np.array(body["upper"], float)
    domain = sc.Domain.box(lower, upper, 0.2 * (upper - lower).min())
    incision = sc.Incision([sc.read_sheet(CASES / case["name"] / "cut.obj")], domain) if "cut" in case else None
    spacing, fine, seeds = spacing_of(case, incision, coarser)
    nodes = sc.sprinkle(domain, spacing, seeds=seeds or None, random_seed=seed, incision=incision).nodes
    lips = {}
    if "relieves" in case:
        lips["lip_traction"] = lambda x, normal: -np.array(relieved_stress(case, x)) @ normal
    material = sc.Material(*moduli_of(case))
    cut_body = sc.Body(domain, nodes, material, held_of(case, fine), traction=traction_of(case), incision=incision, **lips)
    field = cut_body.solve()
    values = {}
    for quantity in case["quantities"]:
        kind = quantity["kind"]
        if kind == "jump":
            points = np.array(quantity["points"])
            off = 1e-4 * fine * np.array(case["cut"]["normal"], float)
            jump = cut_body.at(points + off, field).displacement - cut_body.at(points - off, field).displacement
            values[quantity["name"]] = jump[:, "xyz".index(quantity["axis"])]
        elif kind == "intensity":
            fronts = [incision.front_frame(point, fine) for point in quantity["points"]]
            values[quantity["name"]] = np.array([sc.interaction_integral(cut_body, field, front)[quantity["mode"] - 1] for front in fronts])
        elif kind == "reaction":
            axis, _, coordinate = face_of(quantity["where"], body)
            on_face = np.abs(nodes.positions[cut_body.held_nodes, axis] - coordinate) < 1e-9
            total = cut_body.constraint_forces(field)[on_face].sum(axis=0)
            values[quantity["name"]] = np.array([total["xyz".index(quantity["axis"])]])
        else:
            values[quantity["name"]] = np.array([press(case, cut_body, fine)])
    return values, len(nodes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="node sets, 1 to 100")
    parser.add_argument("--coarse", action="store_true", help="nodes twice as far apart")
    given = parser.parse_args()
    if not 1 <= given.seeds <= 100:
        raise BadInput(f"--seeds {given.seeds}: out of range; allowed: 1 to 100")
    command = "run_spherecut.py" + (" --coarse" if given.coarse else "") + f" --seeds {given.seeds}"
    result = {"code": "Spherecut", "version": sc.__version__, "command": command, "cases": {}}
    for case in chosen_cases(given.cases):
        runs = [compute(case, seed, 2.0 if given.coarse else 1.0) for seed in range(1, given.seeds + 1)]
        values = {name: np.median([run[0][name] for run in runs], axis=0).tolist() for name in runs[0][0]}
        result["cases"][case["name"]] = {"nodes": runs[0][1], "values": values}
        told = [f"{q['name']} {100 * error_of(q, values[q['name']]):.2f} %" for q in case["quantities"]]
        print(f"{case['name']}, {runs[0][1]} nodes: off by {', '.join(told)}", flush=True)
    write_result(given.out, result)
    return 0


if __name__ == "__main__":
    run_main(main)
