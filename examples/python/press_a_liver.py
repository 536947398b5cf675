"""Presses a ball into a liver: surface from arrays, nodes fine at the contact, force over depth, stress on the skin.

python3 press_a_liver.py [--out FOLDER]
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

# Arrays as any reader of surfaces gives them: vertices in metres, and triangles.
made = sc.make_liver(5000)
checked = sc.check_surface(made.vertices, made.triangles, name="liver")
domain = sc.Domain.organ(checked.surface)

skin = checked.surface.vertices
place = skin[np.argmin(np.linalg.norm(skin - [-0.03, 0.0, 0.06], axis=1))]
outward = domain.normal(place[None])[0]
spacing = sc.Spacing(0.004, 0.02, radius=0.012, centres=place[None])
nodes = sc.sprinkle(domain, spacing, seeds=place[None]).nodes

held = [sc.Held(sc.Region.half_space([0, 0, -0.03], [0, 0, 1])), sc.Held(sc.Region.half_space([0, 0.045, 0], [0, -1, 0]))]
body = sc.Body(domain, nodes, sc.Material(6e3, 0.45), held, touched_from=outward)
near = np.linalg.norm(nodes.positions - place, axis=1) < 0.018
patch = sc.condense(body, np.flatnonzero(near & nodes.on_surface()))

ball = sc.Tool.sphere_tip(0.0075)
depths, forces, state = np.linspace(0.0005, 0.005, 10), [], None
for depth in depths:
    state = sc.press(patch, ball, ball.pose_at(place - depth * outward, outward), previous=state)
    forces.append(np.linalg.norm(state.force))
field = sc.deform(patch, state)
print(f"{len(nodes)} nodes; {forces[-1]:.3f} N at {1e3 * depths[-1]:.1f} mm, {state.active_nodes} nodes in contact")

on_skin = np.flatnonzero(nodes.on_surface())
values = body.at(nodes.positions[on_skin], field)
moved = nodes.positions[on_skin] + values.displacement

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
left.plot(1e3 * depths, forces, "o-")
left.set(xlabel="depth [mm]", ylabel="force on the tool [N]", title="A ball of 7.5 mm pressed into a liver")
drawn = right.scatter(1e3 * moved[:, 0], 1e3 * moved[:, 2], c=values.von_mises(), s=12, cmap="viridis")
right.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", title="nodes of the surface")
figure.colorbar(drawn, label="von Mises stress [Pa]")
figure.tight_layout()
figure.savefig(out / "press_a_liver.png", dpi=100)

try:
    import pyvista as pv
except ImportError:
    pass
else:  # the skin itself, deformed: a displacement for each vertex is that of the nearest node of the surface
    nearest = np.argmin(np.linalg.norm(skin[:, None] - nodes.positions[on_skin][None], axis=2), axis=1)
    faces = np.column_stack([np.full(len(made.triangles), 3), checked.surface.triangles])
    mesh = pv.PolyData(skin + values.displacement[nearest], faces)
    mesh["von Mises stress [Pa]"] = values.von_mises()[nearest]
    plotter = pv.Plotter(off_screen=True)
    plotter.add_mesh(mesh)
    plotter.screenshot(out / "press_a_liver_surface.png")
