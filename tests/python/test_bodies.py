"""Mechanics through arrays, against what is known: linear fields, Sneddon's penny, balance of forces."""

import numpy as np
import pytest
import spherecut as sc
from conftest import block_nodes

STRAIN = np.array([[0.01, 0.004, 0.0], [0.0, -0.005, 0.002], [0.003, 0.0, 0.007]])


# The weak form integrates rational shape functions by quadrature: docs/experiments/patch_test.md. There 9 nodes a side are
# right to 1e-3; here are 5.
@pytest.mark.parametrize("method, bound", [("galerkin", 4e-3), ("collocation", 1e-10)])
def test_linear_patch(method, bound):
    """A linear displacement of the foot, and the traction of its stress on the rest: linear inside, with Hooke's law."""
    domain, nodes = block_nodes()
    material = sc.Material(1e4, 0.3)
    strain = (STRAIN + STRAIN.T) / 2
    stress = material.lame_lambda * np.trace(strain) * np.eye(3) + 2 * material.shear_modulus * strain
    foot = sc.Held(lambda x, n: x[2] < 1e-9 and n[2] < -0.5, displacement=lambda x: STRAIN @ x)
    body = sc.Body(domain, nodes, material, [foot], traction=lambda x, n: stress @ n, method=method)
    field = body.solve()
    exact = nodes.positions @ STRAIN.T
    assert np.linalg.norm(body.nodal_displacements(field) - exact) < bound * np.linalg.norm(exact)
    points = np.random.default_rng(3).uniform([-0.017, -0.012, 0.003], [0.017, 0.012, 0.017], (50, 3))
    values = body.at(points, field)
    assert np.linalg.norm(values.displacement - points @ STRAIN.T) < 10 * bound * np.linalg.norm(points @ STRAIN.T)
    assert np.linalg.norm(values.stress - stress, axis=(1, 2)).max() < 50 * bound * np.linalg.norm(stress)
    deviator = stress - np.trace(stress) / 3 * np.eye(3)
    assert values.von_mises() == pytest.approx(np.sqrt(1.5 * np.sum(deviator**2)), rel=100 * bound)
    assert np.allclose(values.strain, (values.gradient + values.gradient.transpose(0, 2, 1)) / 2, atol=1e-15)


def test_regions_hold_as_functions_do():
    domain, nodes = block_nodes()
    base = sc.Region.half_space([0, 0, 1e-9], [0, 0, 1])

    def solved(region):
        body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), [sc.Held(region)], body_force=[0, 0, -1e4])
        return body, body.solve()

    body, by_region = solved(base)
    _, by_function = solved(lambda x, normal: x[2] <= 2e-9)
    assert np.array_equal(by_region.coefficients, by_function.coefficients)
    weight = 1e4 * 0.04 * 0.03 * 0.02
    assert body.constraint_forces(by_region).sum(axis=0) == pytest.approx([0, 0, weight], abs=1e-3 * weight)
    assert body.residual(by_region) < 1e-8
    top = body.at([0, 0, 0.0199], by_region).displacement[0, 2]
    assert -1e4 * 0.02**2 / 2 / 1e4 < top < 0  # less than the bar that may narrow freely, as its foot may not


def test_components_are_held_apart():
    """A block on rollers, drawn by a traction: uniaxial stress."""
    domain, nodes = block_nodes()
    planes = [([-0.02, 0, 0], 0), ([0, -0.015, 0], 1), ([0, 0, 0], 2)]
    held = [
        sc.Held(sc.Region.half_space(point, np.eye(3)[a]), components=[k == a for k in range(3)]) for point, a in planes
    ]
    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), held,
                   traction=lambda x, n: [100.0 * (n[0] > 0.9), 0, 0], method="collocation")
    values = body.at([[0.0, 0.0, 0.01], [0.01, 0.005, 0.015]], body.solve())
    assert values.stress[:, 0, 0] == pytest.approx(100, rel=1e-6)
    assert np.abs(values.stress - 100 * np.diag([1, 0, 0])).max() < 1e-3
    assert values.strain[:, 1, 1] == pytest.approx(-0.3 * 100 / 1e4, rel=1e-6)


def test_fields_are_superposed():
    domain, nodes = block_nodes(0.008)
    base = [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))]
    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), base, body_force=[0, 0, -1e4])
    top = np.flatnonzero((nodes.positions[:, 2] > 0.0199) & nodes.on_surface())[:2].astype(np.int64)
    forces = np.array([[0, 0, -0.1], [0.02, 0, 0]])
    both = body.force_response(top, forces)
    one = body.force_response(top[:1], forces[:1]).plus(body.force_response(top[1:], forces[1:]))
    assert both.coefficients == pytest.approx(one.coefficients, abs=1e-12)
    a = body.contact_displacements(top[1:], body.force_response(top[:1], [[1, 0, 0]]))[0, 2]
    b = body.contact_displacements(top[:1], body.force_response(top[1:], [[0, 0, 1]]))[0, 0]
    assert a == pytest.approx(b, rel=1e-9)  # Maxwell and Betti
    assert body.residual(body.solve().plus(both), top, forces) < 1e-8
    other = sc.Body(*block_nodes(0.009), sc.Material(1e4, 0.3), base)
    with pytest.raises(sc.InputError):
        both.plus(other.solve())


def test_a_press_balances():
    """Force on the tool, on the foot and of the nodes; no penetration, no tension; bits equal again."""
    domain, nodes = block_nodes(0.005)
    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))])
    on_top = (nodes.positions[:, 2] > 0.0199) & (np.hypot(nodes.positions[:, 0], nodes.positions[:, 1]) < 0.012)
    patch = sc.condense(body, np.flatnonzero(on_top))
    assert np.allclose(patch.compliance, patch.compliance.T, rtol=0, atol=1e-9 * np.abs(patch.compliance).max())
    ball = sc.Tool.sphere_tip(0.01)
    state = None
    for depth in (0.0005, 0.001, 0.0015):
        pose = ball.pose_at([0.0003, 0.0002, 0.02 - depth])
        state = sc.press(patch, ball, pose, previous=state)
    assert state.converged and state.force[2] > 0.05
    assert state.nodal_forces.sum(axis=0) == pytest.approx(-state.force, abs=1e-12)
    places = patch.rest + state.displacement
    levers = places - np.asarray(pose.point)
    assert state.torque == pytest.approx(-np.cross(levers, state.nodal_forces).sum(axis=0), abs=1e-12)
    other = np.array([0.01, -0.02, 0.05])
    moved = state.torque + np.cross(np.asarray(pose.point) - other, state.force)
    assert state.torque_about(other) == pytest.approx(moved, abs=1e-12) and np.linalg.norm(moved) > 1e-4
    with pytest.raises(sc.InputError, match="point"):
        state.torque_about([0, 0])
    assert np.all(state.nodal_forces[~state.active] == 0)
    gaps = ball.distance(pose, patch.rest + state.displacement)
    assert gaps.min() > -1e-8 and np.abs(gaps[state.active]).max() < 1e-8
    field = sc.deform(patch, state)
    assert body.constraint_forces(field).sum(axis=0) == pytest.approx(state.force, abs=1e-9)
    assert body.residual(field, patch.nodes, state.nodal_forces) < 1e-8
    direct = sc.press(patch, ball, pose)
    assert direct.force == pytest.approx(state.force, rel=1e-6)
    rubbing = sc.press(patch, ball, pose, condition="frictional", friction=0.3)
    assert rubbing.force[2] > direct.force[2]
    bonded = sc.prescribe(patch, np.zeros((len(patch.nodes), 3)))
    assert np.abs(bonded.force).max() < 1e-12
    with pytest.raises(sc.InputError, match="condition: 'sticky'; allowed: frictionless, frictional, bonded"):
        sc.press(patch, ball, pose, condition="sticky")


def test_first_touch_and_walk():
    liver = sc.make_liver(5000)
    query, ball = sc.ContactQuery(liver), sc.Tool.sphere_tip(0.008)
    top = liver.vertices[np.argmax(liver.vertices[:, 2])]
    last = query.first_touch(ball, ball.pose_at(top + [0, 0, -0.004]))
    assert last.depth == pytest.approx(0.004, rel=0.05)
    for k in range(5):
        pose = ball.pose_at(top + [0.002 * k, 0.001 * k, -0.004])
        last = query.walk(ball, pose, last)
        assert last.depth == query.first_touch(ball, pose).depth


def penny(pressure=100.0, radius=0.01, fine=0.0035):
    domain = sc.Domain.box([-0.04, -0.04, 0], [0.04, 0.04, 0.08], 0.01)
    normal = np.array([0.2, 0.1, 1]) / np.linalg.norm([0.2, 0.1, 1])
    incision = sc.Incision([sc.disc_sheet([0.001, -0.002, 0.0405], normal, radius, 0.002)], domain)
    spacing = sc.Spacing(fine, 0.01, segments=sc.front_segments(incision, fine))
    nodes = sc.sprinkle(domain, spacing, incision=incision).nodes
    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))],
                   incision=incision, lip_traction=lambda x, n: -pressure * n)
    return body, incision


def test_penny_against_sneddon():
    pressure, radius = 100.0, 0.01
    body, incision = penny(pressure, radius)
    field = body.solve()
    places = sc.front_samples(incision, 0.006)
    k = np.mean([sc.interaction_integral(body, field, place) for place in places], axis=0)
    sneddon = 2 * pressure * np.sqrt(radius / np.pi)
    assert k[0] == pytest.approx(sneddon, rel=0.03) and np.abs(k[1:]).max() < 0.03 * sneddon
    material = body.material
    release = (1 - 0.3**2) / 1e4 * k[0] ** 2
    assert sc.energy_release_rate(material, [k[0], 0, 0]) == pytest.approx(release)
    lips = sc.condense_lips(body)
    opening = 8 * (1 - 0.3**2) * pressure * radius / (np.pi * 1e4)
    assert lips.base_opening.max() == pytest.approx(opening, rel=0.06)
    assert not sc.close_lips(lips).closed.any()

    states = sc.front_states(body, field, 2.0, 0.006)
    layered = sc.front_states(body, field, lambda x: 2.0 if x[0] < 0 else 3.0, 0.006)
    for plain, own in zip(states, layered):
        assert np.array_equal(plain.intensities, own.intensities)
        assert own.toughness == (2.0 if own.frame.point[0] < 0 else 3.0) and plain.toughness == 2.0
    motion = sc.tear_motion(sc.front_states(body, field, 0.5 * release, 0.006), 0.002, 0.003)
    grown = sc.grow_front(incision, motion, 0.002)
    assert grown["triangles"] > 0 and 0 < grown["area"] <= np.pi * (0.012**2 - 0.01**2) * 1.01
    assert sc.kink_angle([0, 1, 0]) == pytest.approx(np.radians(-70.53), abs=1e-4)


def test_errors_of_mechanics_are_told():
    domain, nodes = block_nodes(0.008)
    material = sc.Material(1e4, 0.3)
    with pytest.raises(sc.InputError, match=r"held\[0\]: no surface node"):
        sc.Body(domain, nodes, material, [sc.Held(sc.Region.sphere([1, 1, 1], 0.1))])
    with pytest.raises(sc.InputError, match="galerkin"):
        sc.Body(domain, nodes, material, [sc.Held(lambda x, n: True)], method="finite elements")
    with pytest.raises(sc.InputError):
        sc.Body(domain, nodes, material, [])
    body = sc.Body(domain, nodes, material, [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))])
    with pytest.raises(sc.InputError):
        body.at([[1.0, 1.0, 1.0]], body.solve())
    with pytest.raises(sc.InputError, match="nodes: number 0 in C order is 99999"):
        body.force_response(np.array([99999]), [[0, 0, 1]])
    with pytest.raises(sc.InputError, match="body: it has no cut"):
        sc.front_states(body, body.solve(), 1.0, 0.01)


def test_a_law_as_a_function_gives_what_the_built_in_one_gives():
    domain, nodes = block_nodes(0.009)
    built_in = sc.Material(1e4, 0.45, 1100.0)

    def law(strain):
        return built_in.lame_lambda * np.trace(strain) * np.eye(3) + 2 * built_in.shear_modulus * strain

    told = sc.material_of_law(law, 1100.0)
    assert abs(told.young_modulus / 1e4 - 1) < 1e-12 and abs(told.poisson_ratio - 0.45) < 1e-12
    held = [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))]
    fields = []
    for material in (built_in, told):
        body = sc.Body(domain, nodes, material, held, body_force=[0, 0, -1e4])
        fields.append(body.nodal_displacements(body.solve()))
    assert np.abs(fields[0] - fields[1]).max() < 1e-10 * np.abs(fields[0]).max()


def test_a_law_that_the_solvers_do_not_know_is_refused():
    def stiffening(strain):
        return 1e4 * (1 + np.trace(strain @ strain)) * strain

    def along_fibres(strain):
        return 1e4 * strain + 1e4 * np.diag([strain[0, 0], 0, 0])

    for law, words in [
        (stiffening, "not linear and isotropic"),
        (along_fibres, "not linear and isotropic"),
        (lambda strain: "stiff", "no array of numbers"),
        (lambda strain: strain[0], "shape"),
        (lambda strain: strain * np.nan, "not finite"),
        (lambda strain: -1e4 * strain, "mu and lambda"),
        (lambda strain: 1e4 * np.trace(strain) * np.eye(3), "mu and lambda"),
    ]:
        with pytest.raises(sc.InputError, match=words):
            sc.material_of_law(law)
