"""A penny-shaped crack under pressure in a large block, against Sneddon's solution: K along the front, opening.

python3 penny_against_sneddon.py [--out FOLDER]
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

radius, pressure, fine = 0.01, 100.0, 0.0035  # m, Pa, m
material = sc.Material(1e4, 0.3)
domain = sc.Domain.box([-0.04, -0.04, 0], [0.04, 0.04, 0.08], 0.01)
centre, normal = np.array([0.001, -0.002, 0.0405]), np.array([0.2, 0.1, 1.0])
incision = sc.Incision([sc.disc_sheet(centre, normal, radius, 0.002)], domain)
spacing = sc.Spacing(fine, 0.01, segments=sc.front_segments(incision, fine))
nodes = sc.sprinkle(domain, spacing, incision=incision).nodes
base = sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))
body = sc.Body(domain, nodes, material, [base], incision=incision, lip_traction=lambda x, n: -pressure * n)
field = body.solve()

places = sc.front_samples(incision, 0.004)
k = np.array([sc.interaction_integral(body, field, place) for place in places])
exact = 2 * pressure * np.sqrt(radius / np.pi)
print(f"{len(nodes)} nodes; K_I = {k[:, 0].mean():.3f} Pa sqrt(m), Sneddon {exact:.3f}: {100 * (k[:, 0].mean() / exact - 1):+.1f} %")

lips = sc.condense_lips(body)
pairs = nodes.positions[lips.pairs[:, 0]]
from_centre = np.linalg.norm(pairs - centre, axis=1)
r = np.linspace(0, radius, 100)
profile = 8 * (1 - 0.3**2) * pressure / (np.pi * 1e4) * np.sqrt(radius**2 - r**2)

around = np.degrees(np.arctan2(*(np.array([p.point for p in places]) - centre)[:, 1::-1].T))
order = np.argsort(around)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
for row, name in enumerate(["I", "II", "III"]):
    left.plot(around[order], k[order, row], "o-", label=f"$K_{{{name}}}$")
left.axhline(exact, color="black", label="Sneddon, mode I")
left.set(xlabel="around the front [degrees]", ylabel="K [Pa m$^{1/2}$]")
left.legend()
right.plot(1e3 * from_centre, 1e6 * lips.base_opening, "o", label="pairs of nodes")
right.plot(1e3 * r, 1e6 * profile, "black", label="Sneddon")
right.set(xlabel="from the centre [mm]", ylabel="opening [um]")
right.legend()
figure.tight_layout()
figure.savefig(out / "penny_against_sneddon.png", dpi=100)
if abs(k[:, 0].mean() / exact - 1) > 0.03:
    raise SystemExit("K_I is more than 3 % from Sneddon's")
