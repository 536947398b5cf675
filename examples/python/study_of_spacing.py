"""A study of node spacing: a block under its weight between two walls, whose exact solution is a parabola.

python3 study_of_spacing.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import spherecut as sc

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("."))
out = parser.parse_args().out

size, weight, material = 0.03, 1e4, sc.Material(1e4, 0.3)  # m, N/m3
stiffness = material.lame_lambda + 2 * material.shear_modulus


def exact(x):
    """Displacement, m, of a layer on a stiff base that cannot widen: u_z = -w (2 H z - z^2) / (2 (lambda + 2 mu))."""
    u = np.zeros_like(x)
    u[..., 2] = -weight * (2 * size * x[..., 2] - x[..., 2] ** 2) / (2 * stiffness)
    return u


domain = sc.Domain.box([-size / 2, -size / 2, 0], [size / 2, size / 2, size], size / 6)
# The base and the sides move as the layer does; the top is free.
held = [sc.Held(lambda x, n: n[2] < 0.5 and x[2] < size - 1e-9, displacement=exact)]
spacings = np.array([0.0075, 0.006, 0.005, 0.004])
errors: dict[str, list[float]] = {"galerkin": [], "collocation": []}
counts = []
for h in spacings:
    nodes = sc.sprinkle(domain, sc.Spacing(h)).nodes
    counts.append(len(nodes))
    inside = nodes.positions[nodes.kinds == int(sc.NodeKind.INTERIOR)]
    for method, found in errors.items():
        body = sc.Body(domain, nodes, material, held, body_force=[0, 0, -weight], method=method)
        off = body.at(inside, body.solve()).displacement - exact(inside)
        found.append(float(np.linalg.norm(off) / np.linalg.norm(exact(inside))))
for method, found in errors.items():
    print(f"{method}: " + ", ".join(f"{n} nodes {100 * e:.2f} %" for n, e in zip(counts, found)))

figure, axes = plt.subplots(figsize=(6, 4.2))
for method, found in errors.items():
    axes.loglog(1e3 * spacings, 100 * np.array(found), "o-", label=method)
axes.set(xlabel="spacing of nodes [mm]", ylabel="error of the displacement [%]", title="A layer under its weight")
axes.legend()
figure.tight_layout()
figure.savefig(out / "study_of_spacing.png", dpi=100)
