"""Slices a stretched block, step by step, and measures how the cut gapes.

python3 cut_and_gape.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import spherecut as sc
from matplotlib.collections import PolyCollection

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("."))
out = parser.parse_args().out

SCENARIO = """
title = "A cut into a stretched block"
[organ]
shape = "block"
size = [0.06, 0.03, 0.03]
[material]
young_modulus = 10000.0
poisson_ratio = 0.3
pretension = [0.05, 0.0, 0.0] # 5 % along x
[[fixed]]
name = "base"
region = "half_space"
point = [0.0, 0.0, 0.0005]
normal = [0.0, 0.0, 1.0]
[nodes]
coarse_spacing = 0.006
[cut]
front_spacing = 0.003
[blade]
edge = [[0.0, -0.02, 0.0], [0.0, 0.02, 0.0]]
step = 0.1
[[blade.path]]
time = 0.0
position = [0.003, 0.0, 0.034]
[[blade.path]]
time = 1.0
position = [0.001, 0.0, 0.012]
"""

run = sc.run(sc.Scenario.from_text(SCENARIO))
cuts = run.cuts
print(f"cut {1e4 * cuts['area_m2'][-1]:.2f} cm2, opened by {1e3 * cuts['opening_m'][-1]:.2f} mm, "
      f"{cuts['nodes'][-1]} nodes, {cuts['pieces'][-1]} piece(s)")

surface = run.session.surface()
at_rest = (surface["points"] - surface["displacement"])[surface["triangles"]]
front_side = surface["points"][surface["triangles"]][at_rest[..., 1].max(axis=1) < -0.015 + 1e-6]
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
left.plot(1e4 * cuts["area_m2"], 1e3 * cuts["opening_m"], "o-")
left.set(xlabel="area of the cut [cm$^2$]", ylabel="opening [mm]", title="how it gapes")
right.add_collection(PolyCollection(1e3 * front_side[:, :, [0, 2]], facecolor="#d9a79c", edgecolor="#7a3b30", linewidth=0.5))
right.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", xlim=(-34, 34), ylim=(-2, 34), title="the block from its side")
figure.tight_layout()
figure.savefig(out / "cut_and_gape.png", dpi=100)
try:
    import pyvista as pv
except ImportError:
    pass
else:
    import numpy as np

    faces = np.column_stack([np.full(len(surface["triangles"]), 3), surface["triangles"]])
    mesh = pv.PolyData(surface["points"], faces)
    mesh.cell_data["part"] = surface["part"]
    plotter = pv.Plotter(off_screen=True)
    plotter.add_mesh(mesh, scalars="part")
    plotter.screenshot(out / "cut_and_gape_surface.png")
