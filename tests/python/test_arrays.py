"""Arrays: what is the library's memory, what is a copy, and what is refused in which words."""

import gc
import pickle

import numpy as np
import pytest
import spherecut as sc
from conftest import block_nodes

TETRAHEDRON = (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.01, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def test_views_alias_and_outlive_their_owner():
    surface = sc.make_block([0, 0, 0], [0.02, 0.02, 0.02], 0.005)
    first, second = surface.vertices, surface.vertices
    assert np.shares_memory(first, second)  # the surface's memory, not two copies
    assert first.flags.c_contiguous and not first.flags.owndata and not first.flags.writeable
    with pytest.raises(ValueError):
        first[0, 0] = 1
    with pytest.raises(ValueError):
        first.flags.writeable = True
    kept = first.copy()
    del surface, second
    gc.collect()
    assert np.array_equal(first, kept)  # the array keeps its owner


def test_results_are_memory_that_the_array_has_taken_over():
    domain, _ = block_nodes()
    distances = domain.signed_distance(np.zeros((1000, 3)) + [0, 0, 0.01])
    assert not distances.flags.owndata and distances.flags.writeable
    distances[:] = 7
    assert np.all(distances == 7)


def test_arrays_that_go_in_are_copied():
    vertices, triangles = TETRAHEDRON[0].copy(), TETRAHEDRON[1].copy()
    surface = sc.Surface(vertices, triangles)
    vertices[:] = 0
    triangles[:] = 0
    assert surface.volume == pytest.approx(1e-6 / 6)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_any_layout_goes_in(order, kind):
    vertices = np.array(TETRAHEDRON[0], dtype=kind, order=order)
    surface = sc.Surface(vertices[::1], np.asfortranarray(TETRAHEDRON[1].astype(np.uint16)))
    assert np.allclose(surface.vertices, TETRAHEDRON[0], atol=1e-9)
    assert surface.area == pytest.approx((3 + np.sqrt(3)) / 2 * 1e-4, rel=1e-6)


def test_gradients_are_rows_i_columns_j():
    domain, nodes = block_nodes(0.01)
    shear = np.zeros((3, 3))
    shear[0, 2] = 0.01  # u_x = 0.01 z
    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), [sc.Held(lambda x, n: n[2] < -0.5 and x[2] < 1e-9)],
                   traction=lambda x, n: 1e4 / 2.6 * (shear + shear.T) @ n, method="collocation")
    values = body.at([[0.001, 0.002, 0.011]], body.solve())
    assert np.allclose(values.gradient[0], shear, atol=1e-9)
    assert values.gradient.strides == (72, 8, 24)  # Eigen's columns come first: no copy


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: sc.Surface([[0, 0]], np.zeros((0, 3), int)), "vertices: an array of shape (1, 2); allowed: (n, 3)"),
        (lambda: sc.Surface([[0, 0, np.nan]], np.zeros((0, 3), int)), "vertices: number 2 in C order is nan; allowed: finite numbers"),
        (lambda: sc.Surface(TETRAHEDRON[0], np.array([[0, 1, 4]])), "triangles: number 2 in C order is 4; allowed: 0 to 3"),
        (lambda: sc.Surface(TETRAHEDRON[0], np.array([[0, 1, 2.5]])), "triangles: numbers of type float64; allowed: whole numbers"),
        (lambda: sc.Tool.sphere_tip(-1), "radius"),
        (lambda: sc.Material(-1, 0.3), "Young's modulus"),
        (lambda: sc.Region.sphere([0, 0, 0], 0), "radius: 0 m; allowed: above 0"),
        (lambda: sc.BladePose(0, [0, 0, 0], [1, 1, 0, 0]), "orientation: a quaternion of length 1.41421; allowed: 1"),
        (lambda: sc.BladePose(0, [0, 0, 0], -np.eye(3)), "orientation: no rotation"),
        (lambda: sc.Nodes([[0, 0, 0]], [0.1, 0.1], np.array([0])), "spacings: 2 of them for 1 positions; allowed: as many"),
        (lambda: sc.set_thread_count(0), "thread"),
    ],
)
def test_bad_input_is_told(call, words):
    with pytest.raises(sc.InputError) as told:
        call()
    assert words.lower() in str(told.value).lower()
    assert isinstance(told.value, ValueError)


def test_surfaces_from_elsewhere_are_mended_or_refused():
    vertices, triangles = TETRAHEDRON
    inward = triangles[:, ::-1]
    doubled = np.vstack([vertices, vertices])  # every corner twice, as an STL file has them
    checked = sc.check_surface(doubled, np.where(np.arange(4)[:, None] % 2, inward + 4, inward))
    assert checked.surface.volume == pytest.approx(1e-6 / 6)
    assert len(checked.surface.vertices) == 4 and checked.mended
    quads = sc.check_surface(np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.01,
                             [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    assert quads.surface.volume == pytest.approx(1e-6)
    strip = np.array([[k, side, 0.1 * (k % 2)] for k in range(40) for side in (0, 1)]) * 0.001
    with pytest.raises(sc.InputError, match="^strip"):
        sc.check_surface(strip, np.array([[2 * k, 2 * k + 1, 2 * k + 3] for k in range(39)]), name="strip")


def test_labels_become_a_surface_in_their_place():
    labels = np.zeros((12, 14, 16), dtype=np.uint8)
    labels[2:10, 3:11, 4:14] = 5
    checked = sc.label_surface(labels, [0.1, 0.2, 0.3], np.diag([0.002, 0.002, 0.001]))
    box = checked.surface.bounds
    assert np.allclose(box[0], [0.1 + 0.002 * 1.5, 0.2 + 0.002 * 2.5, 0.3 + 0.001 * 3.5], atol=1.1e-3)
    assert np.allclose(box[1], [0.1 + 0.002 * 9.5, 0.2 + 0.002 * 10.5, 0.3 + 0.001 * 13.5], atol=1.1e-3)
    assert checked.surface.volume == pytest.approx(8 * 8 * 10 * 0.002 * 0.002 * 0.001, rel=0.1)


def test_surfaces_are_pickled():
    surface = sc.make_hemisphere(0.02, 0.006)
    copy = pickle.loads(pickle.dumps(surface))
    assert np.array_equal(copy.vertices, surface.vertices) and np.array_equal(copy.triangles, surface.triangles)


def test_cuts_as_arrays():
    organ = sc.make_block([-0.02, -0.02, 0], [0.02, 0.02, 0.02], 0.005)
    domain = sc.Domain.organ(organ)
    sheet = sc.rectangle_sheet([0.0031, 0, 0.01], [1, 0, 0], [0, 0, 1], 0.1, 0.1, 0.004)  # right through
    incision = sc.Incision([sheet], domain)
    assert incision.area == pytest.approx(0.04 * 0.02, rel=1e-6) and len(incision.front) == 0
    a, b = np.array([0.0, 0.001, 0.01]), np.array([[0.01, 0, 0.01], [-0.01, 0, 0.01], [0.003, 0.01, 0.015]])
    assert incision.blocks(a, b).tolist() == [True, False, False]
    near = incision.closest([[0.0, 0.0, 0.01], [0.0031, 0.0, 0.5]], 0.01)
    assert near["distance"][0] == pytest.approx(0.0031) and np.isinf(near["distance"][1]) and near["sheet"][1] == -1
    wound = sc.cut_surface(organ, [sheet])
    assert np.sort(wound.volumes) == pytest.approx([0.0169 * 0.04 * 0.02, 0.0231 * 0.04 * 0.02], rel=1e-9)
    assert set(wound.piece[wound.part == 1]) != set(wound.piece[wound.part == 2])
    assert np.allclose(wound.vertices[wound.triangles[wound.part > 0]][..., 0], 0.0031)

    half = sc.Incision([sc.rectangle_sheet([0, 0, 0.02], [1, 0, 0], [0, 0, 1], 0.1, 0.016, 0.004)], domain)
    assert np.allclose(half.front[..., 2], 0.012) and half.front_length == pytest.approx(0.04, rel=1e-6)
    frame = half.front_frame([0.001, 0, 0.01], 0.01)
    assert np.allclose(frame.ahead, [0, 0, -1]) and np.allclose(np.abs(frame.normal), [1, 0, 0])
    length, over = half.detour([-0.003, 0, 0.016], [0.003, 0, 0.016], 0.1)
    assert length == pytest.approx(0.01, rel=1e-3) and np.allclose(over, [0, 0, 0.012], atol=2e-4)
    grown = sc.grow_front(half, lambda place: 0.003 * place.ahead, 0.003)
    assert sc.Incision(grown["sheets"], domain).area == pytest.approx(0.04 * 0.011, rel=1e-3)


def test_a_blade_in_the_hand():
    domain = sc.Domain.box([-0.02, -0.02, 0], [0.02, 0.02, 0.02], 0.005)
    sweep = sc.BladeSweep([[0, -0.03, 0], [0, 0.03, 0]], domain, 0.004)
    for k in range(6):
        said = sweep.move_to(0.1 * k, [0.0013, 0, 0.022 - 0.002 * k])
    assert said["triangles"] > 0 and sweep.incision.area == pytest.approx(0.04 * 0.008, rel=1e-6)
    with pytest.raises(sc.InputError, match="does not come after the one at 0.5 s"):
        sweep.move_to(0.1, [0, 0, 0])
    turned = sc.BladeSweep([[0, -0.03, 0], [0, 0.03, 0]], domain, 0.004)
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    for k in range(2):
        turned.move_to(k, [0, 0, 0.022 - 0.01 * k], quarter, lambda x: x + [0, 0.001, 0])
    assert np.allclose(turned.sheets[0].vertices[:, 1], 0.001)  # the edge lies along x, in the body at rest


def test_growing_wounds_equal_those_cut_at_once():
    organ = sc.make_block([-0.02, -0.02, 0], [0.02, 0.02, 0.02], 0.006)
    sweep = sc.BladeSweep([[0, -0.03, 0], [0, 0.03, 0]], sc.Domain.organ(organ), 0.005)
    wound = sc.IncrementalWound(organ)
    for k in range(4):
        sweep.move_to(k, [0.001, 0, 0.022 - 0.003 * k])
        wound.grow(sweep.sheets)
    at_once = sc.cut_surface(organ, sweep.sheets)
    assert wound.wound.volumes == pytest.approx(at_once.volumes, rel=1e-12)
    assert len(wound.wound.triangles) == len(at_once.triangles)
