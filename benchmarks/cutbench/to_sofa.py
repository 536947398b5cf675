#!/usr/bin/env python3
"""Writes cases as SOFA scenes: linear hexahedra with the cut's nodes doubled, loads and supports node by node, one static solve.

to_sofa.py --out FOLDER [--refine N] [CASE...]

Writes CASE.scn; SOFA leaves CASE.positions, the places of all nodes after the solve. Without CASE: all that such a block can hold.
A flat punch becomes a given displacement of the nodes under it.
"""

import argparse
import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np
from cutbench import BadInput, case_names, chosen_cases, moduli_of, read_case, run_main
from grid import case_forces, given_displacements, make_grid
from to_calculix import can_hold

PLUGINS = [
    "Sofa.Component.Constraint.Projective",
    "Sofa.Component.LinearSolver.Direct",
    "Sofa.Component.MechanicalLoad",
    "Sofa.Component.ODESolver.Backward",
    "Sofa.Component.Playback",
    "Sofa.Component.SolidMechanics.FEM.Elastic",
    "Sofa.Component.StateContainer",
    "Sofa.Component.Topology.Container.Constant",
]


def numbers(values):
    return " ".join(f"{value:.12g}" for value in np.ravel(values))


def scene(case, grid):
    """Supports fix nodes where they stand: those that are moved stand there from the start, their places at rest aside."""
    given, forces = given_displacements(case, grid), case_forces(case, grid, 1)
    modulus, ratio = moduli_of(case)
    start = grid.nodes.copy()
    held = {}
    for (node, axis), value in given.items():
        start[node, axis] += value
        held.setdefault(node, [0, 0, 0])[axis] = 1
    root = xml.Element("Node", name="root", dt="1", gravity="0 0 0")
    for plugin in PLUGINS:
        xml.SubElement(root, "RequiredPlugin", name=plugin)
    xml.SubElement(root, "DefaultAnimationLoop")
    body = xml.SubElement(root, "Node", name=case["name"])
    xml.SubElement(body, "StaticSolver", newton_iterations="1")
    xml.SubElement(body, "SparseLDLSolver", template="CompressedRowSparseMatrixMat3x3d")
    xml.SubElement(body, "MeshTopology", name="mesh", position=numbers(grid.nodes), hexahedra=numbers(grid.elements))
    xml.SubElement(body, "MechanicalObject", name="state", template="Vec3d", position=numbers(start), rest_position=numbers(grid.nodes))
    xml.SubElement(body, "HexahedronFEMForceField", method="small", youngModulus=f"{modulus:.12g}", poissonRatio=f"{ratio:.12g}")
    for axes in sorted({tuple(axes) for axes in held.values()}):
        members = [node for node in sorted(held) if tuple(held[node]) == axes]
        if axes == (1, 1, 1):
            xml.SubElement(body, "FixedProjectiveConstraint", indices=numbers(members))
        else:
            xml.SubElement(body, "PartialFixedProjectiveConstraint", indices=numbers(members), fixedDirections=numbers(axes))
    loaded = np.flatnonzero(np.any(forces != 0, axis=1))
    if len(loaded):
        xml.SubElement(body, "ConstantForceField", indices=numbers(loaded), forces=numbers(forces[loaded]))
    xml.SubElement(body, "WriteState", filename=f"{case['name']}.positions", writeX="1", time="1")
    xml.indent(root)
    return xml.tostring(root, encoding="unicode") + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--refine", type=int, default=1, metavar="N", help="multiplies the elements a line, 1 to 8")
    given = parser.parse_args()
    if not 1 <= given.refine <= 8:
        raise BadInput(f"--refine {given.refine}: out of range; allowed: 1 to 8")
    cases = chosen_cases(given.cases) if given.cases else [case for case in map(read_case, case_names()) if can_hold(case)]
    scenes = {case["name"]: scene(case, make_grid(case, 1, given.refine)) for case in cases}
    try:
        given.out.mkdir(parents=True, exist_ok=True)
        for name, text in scenes.items():
            (given.out / f"{name}.scn").write_text(text)
            print(f"{name}.scn", flush=True)
    except OSError as error:
        raise BadInput(f"{given.out}: {error.strerror}") from None
    return 0


if __name__ == "__main__":
    run_main(main)
