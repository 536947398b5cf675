"""A surface that meshio reads, where that is installed, comes in as arrays: so do all formats that it knows."""

import numpy as np
import pytest
import spherecut as sc


@pytest.mark.parametrize("name", ["block.stl", "block.vtk", "block.off"])
def test_meshio(tmp_path, name):
    meshio = pytest.importorskip("meshio")
    block = sc.make_block([0, 0, 0], [0.04, 0.03, 0.02], 0.01)
    meshio.Mesh(np.array(block.vertices), [("triangle", np.array(block.triangles))]).write(tmp_path / name)
    mesh = meshio.read(tmp_path / name)
    checked = sc.check_surface(mesh.points, mesh.cells_dict["triangle"])
    assert checked.surface.volume == pytest.approx(block.volume, rel=1e-6)
    assert sc.Domain.organ(checked.surface).signed_distance([[0.02, 0.015, 0.01]])[0] == pytest.approx(-0.01, abs=1e-3)
