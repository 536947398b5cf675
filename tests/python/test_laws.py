"""Bodies at finite strain, and laws that are Python functions: what the built-in law gives, they give."""

import gc
import signal
import threading
import weakref

import numpy as np
import pytest
import spherecut as sc
from conftest import SMALL, block_nodes

MU = 3e3
LOOSE, NEARLY_RIGID = (2 * MU * (1 + nu) / (3 * (1 - 2 * nu)) for nu in (0.3, 0.49))  # bulk moduli
ONE = np.eye(3)


# The neo-Hookean law by numpy: W = mu/2 (J^(-2/3) tr F^T F - 3) + kappa/4 (J^2 - 1 - 2 ln J).
def energy_of(kappa):
    def energy(f):
        j = np.linalg.det(f)
        return MU / 2 * (j ** (-2 / 3) * np.sum(f * f, axis=(-2, -1)) - 3) + kappa / 4 * (j**2 - 1 - 2 * np.log(j))

    return energy


def stress_of(kappa):
    def stress(f):
        j = np.linalg.det(f)[..., None, None]
        back = np.swapaxes(np.linalg.inv(f), -1, -2)  # F^-T
        trace = np.sum(f * f, axis=(-2, -1))[..., None, None]
        return MU * j ** (-2 / 3) * (f - trace / 3 * back) + kappa / 2 * (j**2 - 1) * back

    return stress


def tangent_of(kappa):
    def tangent(f):
        j = np.linalg.det(f)[..., None, None, None, None]
        back = np.swapaxes(np.linalg.inv(f), -1, -2)
        trace = np.sum(f * f, axis=(-2, -1))[..., None, None, None, None]
        pairs = np.einsum("...ij,...kl->...ijkl", back, back)
        turned = -np.einsum("...il,...kj->...ijkl", back, back)  # dF^-T/dF
        mixed = np.einsum("...ij,...kl->...ijkl", f, back) + np.einsum("...ij,...kl->...ijkl", back, f)
        same = np.einsum("ik,jl->ijkl", ONE, ONE)
        isochoric = same - 2 / 3 * mixed + 2 / 9 * trace * pairs - trace / 3 * turned
        return MU * j ** (-2 / 3) * isochoric + kappa * j**2 * pairs + kappa / 2 * (j**2 - 1) * turned

    return tangent


def functions(kappa, *, stress=True, tangent=True, bulk_modulus=0.0, many=True):
    return sc.Law.of_functions(
        energy_of(kappa), stress_of(kappa) if stress else None, tangent_of(kappa) if tangent else None,
        bulk_modulus=bulk_modulus, many=many)


# What is given, and what the stress and the tangent at a point may then be off by, over the shear modulus.
GIVEN = [
    pytest.param({}, 1e-12, 1e-12, id="all"),
    pytest.param({"tangent": False}, 1e-12, 1e-9, id="no tangent"),
    pytest.param({"stress": False, "tangent": False}, 1e-9, 1e-6, id="energy alone"),
    pytest.param({"many": False}, 1e-12, 1e-12, id="one at a time"),
]


def gradients(count=40, size=0.25):
    f = ONE + size * np.random.default_rng(5).normal(size=(count, 3, 3))
    return f[np.linalg.det(f) > 0.3]


@pytest.mark.parametrize("given, off, tangent_off", GIVEN)
@pytest.mark.parametrize("kappa", [LOOSE, NEARLY_RIGID], ids=["nu 0.3", "nu 0.49"])
def test_a_law_of_functions_at_points(kappa, given, off, tangent_off):
    built_in, f = sc.Law.neo_hookean(MU, kappa), gradients()
    assert len(f) > 20
    stiff = kappa / MU
    for law in (functions(kappa, **given), functions(0.0, bulk_modulus=kappa, **given)):
        assert np.abs(law.energy(f) - built_in.energy(f)).max() < 1e-13 * np.abs(built_in.energy(f)).max()
        assert np.abs(law.stress(f) - built_in.stress(f)).max() < off * stiff * MU * 10
        assert np.abs(law.tangent(f) - built_in.tangent(f)).max() < tangent_off * stiff * MU * 100
        assert law.shear_modulus == pytest.approx(MU, rel=1e-6) and law.bulk_modulus == pytest.approx(kappa, rel=1e-6)
        inside_out = np.diag([-1.0, 1.0, 1.0])  # the functions never see it
        assert np.isposinf(law.energy(inside_out)[0]) and not law.stress(inside_out).any()


def pressed(law, *, nodes=None, tolerance=1e-11, **options):
    """A block on its base, under its weight, its top sheared and a ball pressed into it in two steps."""
    domain, cloud = nodes or block_nodes(0.009)
    base = sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))
    body = sc.FiniteBody(domain, cloud, law, [base], body_force=[2e3, 0, -1e4])
    x = cloud.positions
    on_top = cloud.on_surface() & (x[:, 2] > 0.02 - 1e-9) & (np.hypot(x[:, 0], x[:, 1]) < 0.014)
    state = sc.Equilibrium(body, tolerance=tolerance, penetration=1e-6 if tolerance < 1e-6 else 1e-3, maximum_iterations=400, **options)
    ball = sc.Tool.sphere_tip(0.008)
    state.set_contact(ball, np.flatnonzero(on_top))
    status = [state.solve(ball.pose_at([0, 0, height])) for height in (0.019, 0.016)]
    return body, state, status


def test_a_tool_rubs_sticks_and_holds():
    """Friction keeps Coulomb's limit and pulls against the way; what is held goes along and comes back when let go."""
    domain, cloud = block_nodes(0.009)
    base = sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))
    body = sc.FiniteBody(domain, cloud, sc.Law.neo_hookean(MU, LOOSE), [base])
    x = cloud.positions
    top = np.flatnonzero(cloud.on_surface() & (x[:, 2] > 0.02 - 1e-9) & (np.hypot(x[:, 0], x[:, 1]) < 0.014))
    state = sc.Equilibrium(body)
    ball = sc.Tool.sphere_tip(0.03)
    drawn = {}
    for condition, friction in [("frictionless", 0.0), ("frictional", 0.2), ("bonded", 0.0)]:
        state.set_coefficients(np.zeros_like(state.coefficients))
        state.set_contact(ball, top, condition, friction)
        state.solve(ball.pose_at([0, 0, 0.017]))
        drawn[condition] = -state.solve(ball.pose_at([0.002, 0, 0.017])).tool_force[0]
    assert drawn["bonded"] > drawn["frictional"] > drawn["frictionless"]
    state.set_coefficients(np.zeros_like(state.coefficients))
    state.take_hold(ball, ball.pose_at([0, 0, 0.02]), top)
    assert state.solve(ball.pose_at([0, 0, 0.022])).tool_force[2] < 0
    assert np.abs(body.nodal_displacements(state.coefficients)[top, 2] - 0.002).max() < 6e-4
    state.let_go()
    state.solve()
    assert np.abs(state.coefficients).max() < 1e-5
    with pytest.raises(ValueError, match="coefficient of friction"):
        state.set_contact(ball, top, "frictional", -1.0)


@pytest.fixture(scope="module", params=[LOOSE, NEARLY_RIGID], ids=["nu 0.3", "nu 0.49"])
def press(request):
    kappa = request.param
    return kappa, pressed(sc.Law.neo_hookean(MU, kappa))


@pytest.mark.parametrize("given, off", [pytest.param(p.values[0], o, id=p.id) for p, o in zip(GIVEN, (1e-9, 1e-9, 1e-8, 1e-9))])
def test_a_press_with_a_law_of_functions(press, given, off):
    """Displacement, force, energy and stress are those of the built-in law; near nu = 0.5 with the pressure of blocks."""
    kappa, (body, state, status) = press
    blocks = body.pointwise_share < 1
    assert blocks == (kappa == NEARLY_RIGID)
    law = functions(0.0, bulk_modulus=kappa, **given) if blocks else functions(kappa, **given)
    own_body, own, own_status = pressed(law)
    scale = np.abs(state.coefficients).max()
    assert scale > 1e-3 and status[1].touching >= 2 and status[1].tool_force[2] > 0.1
    assert np.abs(own.coefficients - state.coefficients).max() < off * scale
    for mine, theirs in zip(own_status, status):
        assert np.abs(mine.tool_force - theirs.tool_force).max() < off * np.abs(status[1].tool_force).max()
        assert mine.energy == pytest.approx(theirs.energy, rel=off)
        assert mine.least_jacobian == pytest.approx(theirs.least_jacobian, rel=off)
    assert own.constraint_forces == pytest.approx(state.constraint_forces, abs=10 * off * status[1].tool_force[2])
    places = [[0, 0, 0.012], [0.01, 0.004, 0.006], [-0.013, -0.01, 0.017]]
    mine, theirs = own_body.at(places, own.coefficients), body.at(places, state.coefficients)
    largest = np.abs(theirs.cauchy).max()
    for name in ("cauchy", "first_piola"):
        assert np.abs(getattr(mine, name) - getattr(theirs, name)).max() < 100 * off * largest
    assert mine.deformation == pytest.approx(theirs.deformation, abs=100 * off)
    assert mine.energy == pytest.approx(theirs.energy, rel=1e-6) and np.abs(theirs.deformation - ONE).max() > 0.05


def test_forces_balance_and_are_the_slope_of_the_energy(press):
    _, (body, state, status) = press
    u = state.coefficients
    assert state.contact_forces.sum(axis=0) == pytest.approx(-status[1].tool_force, abs=1e-9)
    total = body.loads.sum(axis=0) + state.constraint_forces.sum(axis=0) - status[1].tool_force
    assert np.abs(total).max() < 1e-8 * status[1].tool_force[2]
    energy, forces = body.evaluate(u)
    assert energy == pytest.approx(status[1].energy, rel=1e-12)
    way = np.random.default_rng(2).normal(size=u.shape)
    h = 1e-8
    slope = (body.evaluate(u + h * way)[0] - body.evaluate(u - h * way)[0]) / (2 * h)
    assert slope == pytest.approx(np.sum(forces * way), rel=1e-6)
    assert body.nodal_displacements(u).shape == u.shape


def test_newton_takes_tangents_of_functions():
    nodes = block_nodes(0.012)
    built_in = pressed(sc.Law.neo_hookean(MU, LOOSE), nodes=nodes, method="newton")
    for given in ({}, {"tangent": False}):
        own = pressed(functions(LOOSE, **given), nodes=nodes, method="newton")
        assert own[2][1].factorisations == built_in[2][1].factorisations > 2
        assert np.abs(own[1].coefficients - built_in[1].coefficients).max() < 1e-9 * np.abs(built_in[1].coefficients).max()


def test_the_same_bits_again_and_with_two_threads():
    nodes = block_nodes(0.007)
    once = pressed(functions(LOOSE), nodes=nodes, tolerance=1e-3)
    again = pressed(functions(LOOSE), nodes=nodes, tolerance=1e-3)
    assert np.array_equal(once[1].coefficients, again[1].coefficients)
    energies = [once[0].evaluate(once[1].coefficients)]
    sc.set_thread_count(2)
    try:
        energies.append(once[0].evaluate(once[1].coefficients))
        two = pressed(functions(LOOSE), nodes=nodes, tolerance=1e-3)
    finally:
        sc.set_thread_count(1)
    assert energies[0][0] == energies[1][0] and np.array_equal(energies[0][1], energies[1][1])
    assert np.array_equal(once[1].coefficients, two[1].coefficients)


@pytest.mark.parametrize("own", [
    lambda built_in: functions(built_in.bulk_modulus), lambda built_in: functions(0.0, bulk_modulus=built_in.bulk_modulus)],
    ids=["whole", "with U(J)"])
def test_a_scenario_with_a_law_of_functions(own, tmp_path):
    """Two steps of a run: the files say the same, and the law's name."""
    young, nu = 9 * LOOSE * MU / (3 * LOOSE + MU), 0.3
    text = SMALL.replace("young_modulus = 10000.0", f'law = "neo_hookean"\nyoung_modulus = {young!r}').replace(
        "step = 0.2", "step = 0.5").replace("fine_spacing = 0.003", "fine_spacing = 0.005").replace("poisson_ratio = 0.3", f"poisson_ratio = {nu}")
    scenario = sc.Scenario.from_text(text)
    built_in = sc.Law.neo_hookean(MU, LOOSE)
    law = own(built_in)
    runs = [sc.run(scenario), sc.run(scenario.with_law(built_in)), sc.run(scenario.with_law(law), tmp_path / "run")]
    linear = sc.run(sc.Scenario.from_text(text.replace('law = "neo_hookean"\n', "")).with_law(law))
    assert runs[0].forces["force_z_N"][-1] > 0.05
    for run in (*runs[1:], linear):
        for column in ("force_x_N", "force_y_N", "force_z_N", "torque_x_Nm", "torque_y_Nm", "torque_z_Nm"):
            assert run.forces[column] == pytest.approx(runs[0].forces[column], abs=1e-8 * runs[0].forces["force_z_N"].max())
    surfaces = [run.session.surface() for run in runs]
    for surface in surfaces[1:]:
        assert surface["displacement"] == pytest.approx(surfaces[0]["displacement"], abs=1e-9 * 0.02)
        assert surface["von_mises"] == pytest.approx(surfaces[0]["von_mises"], abs=1e-6 * surfaces[0]["von_mises"].max())
    summary = (tmp_path / "run" / "summary.json").read_text()
    assert '"law": "functions"' in summary
    with pytest.raises(sc.InputError, match="pickle"):
        import pickle

        pickle.dumps(scenario.with_law(law))
    collocated = text.replace('law = "neo_hookean"\n', "") + '\n[method]\nname = "collocation"\n'
    with pytest.raises(sc.InputError, match='method.name = "collocation" does not go with material.law = "functions"'):
        sc.run(sc.Scenario.from_text(collocated).with_law(law))


def test_an_anisotropic_law_of_functions():
    """Fibres along x by numpy, against the built-in law of fibres."""
    k1, k2, along = 2.4e3, 0.84, np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5])

    def energy(f):
        strain = np.maximum(np.sum((f @ along) ** 2, axis=-1) - 1, 0)
        return energy_of(LOOSE)(f) + k1 / (2 * k2) * np.expm1(k2 * strain**2)

    def stress(f):
        drawn = f @ along
        strain = np.maximum(np.sum(drawn**2, axis=-1) - 1, 0)
        pull = 2 * k1 * strain * np.exp(k2 * strain**2)
        return stress_of(LOOSE)(f) + pull[..., None, None] * drawn[..., :, None] * along

    own, f = sc.Law.of_functions(energy, stress, name="fibres"), gradients()
    built_in = sc.Law.holzapfel_gasser_ogden(MU, k1, k2, along, bulk_modulus=LOOSE)
    assert own.stress(f) == pytest.approx(built_in.stress(f), abs=1e-10 * np.abs(built_in.stress(f)).max())
    assert own.name == "fibres" and np.abs(built_in.stress(f) - sc.Law.neo_hookean(MU, LOOSE).stress(f)).max() > 0.1 * MU


@pytest.mark.parametrize("law, words", [
    (lambda: sc.Law.of_functions(3.0), "energy: 3.0; allowed: a function"),
    (lambda: sc.Law.of_functions(lambda f: "stiff"), "energy: 'stiff'; allowed: an array of numbers"),
    (lambda: sc.Law.of_functions(lambda f: f), r"energy: an array of shape \(.*3, 3\) for .* of F; allowed: \(\d+,\)"),
    (lambda: sc.Law.of_functions(lambda f: f, many=False), r"for one F; allowed: \(\)"),
    (lambda: sc.Law.of_functions(energy_of(LOOSE), lambda f: f[0]), r"stress: an array of shape \(3, 3\)"),
    (lambda: sc.Law.of_functions(lambda f: np.full(len(f), np.nan)), r"energy is nan at F = \[\["),
    (lambda: sc.Law.of_functions(lambda f: np.full(len(f), -np.inf)), r"energy is -inf at F = \[\["),
    (lambda: sc.Law.of_functions(energy_of(LOOSE), lambda f: np.nan * f), r"stress is \[\[nan.* at F = "),
    (lambda: sc.Law.of_functions(energy_of(LOOSE), stress_of(LOOSE), lambda f: np.full(f.shape + (3, 3), np.inf)), "tangent is not finite at F = "),
    (lambda: sc.Law.of_functions(energy_of(LOOSE), lambda f: 2 * stress_of(LOOSE)(f)), "from the slope of the energy at F = .*; allowed: at most"),
    (lambda: sc.Law.of_functions(energy_of(LOOSE), stress_of(LOOSE), lambda f: 1.01 * tangent_of(LOOSE)(f)), "from the slope of the stress at F = "),
    (lambda: sc.Law.of_functions(lambda f: -energy_of(LOOSE)(f)), "allowed: both above 0"),
    (lambda: sc.Law.of_functions(energy_of(0.0)), "the bulk modulus .*; allowed: both above 0"),
    (lambda: sc.Law.of_functions(lambda f: energy_of(LOOSE)(f) + 10 * f[..., 0, 0]), "nothing acts at rest"),
    (lambda: sc.Law.of_functions(energy_of(LOOSE), bulk_modulus=-1.0), "bulk modulus -1.* Pa; allowed: 0, or above it"),
    (lambda: sc.Law.neo_hookean(-MU, LOOSE), "shear_modulus"),
    (lambda: sc.Law.neo_hookean(MU, LOOSE).stress(np.eye(2)), r"gradients: an array of shape \(2, 2\)"),
    (lambda: sc.Law.neo_hookean(MU, LOOSE).stress(np.nan * ONE), "gradients: number 0 is not finite"),
])
def test_what_is_no_law_is_refused(law, words):
    with pytest.raises(sc.InputError, match=words):
        law()


class Own(Exception):
    pass


def failing(how, after):
    """The stress of the law, but from the given call on `how` of it. Its checks at the beginning take ten calls or so."""
    calls = []

    def stress(f):
        calls.append(len(f))
        return stress_of(LOOSE)(f) if len(calls) <= after[0] else how(f)

    return sc.Law.of_functions(energy_of(LOOSE), stress, tangent_of(LOOSE)), calls


@pytest.mark.parametrize("threads", [1, 2])
def test_errors_of_the_functions_come_out_and_the_state_stays(threads):
    def raises(f):
        raise Own("at", len(f))

    def interrupts(f):
        signal.raise_signal(signal.SIGINT)
        return stress_of(LOOSE)(f)

    nan = lambda f: np.where(np.arange(len(f))[:, None, None] == len(f) - 1, np.nan, stress_of(LOOSE)(f))  # noqa: E731
    inside = r"stress is \[\[nan.* at F = \[\[.*\(at -?[\d.e-]+, -?[\d.e-]+, [\d.e-]+ m of the body at rest\)"
    kinds = [(raises, Own, "at"), (nan, sc.InputError, inside)]
    if threads == 1:  # Python handles signals on its main thread
        kinds.append((interrupts, KeyboardInterrupt, ""))
    domain, nodes = block_nodes(0.007)
    base = sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))
    sc.set_thread_count(threads)
    try:
        for how, kind, words in kinds:
            after = [10**9]
            law, calls = failing(how, after)
            body = sc.FiniteBody(domain, nodes, law, [base], body_force=[0, 0, -1e4])
            state = sc.Equilibrium(body)
            state.solve(load_factor=0.5)
            before, forces = state.coefficients, state.constraint_forces
            after[0] = len(calls) + 2
            with pytest.raises(kind, match=words):
                state.solve(load_factor=4.0)
            assert np.array_equal(state.coefficients, before) and np.array_equal(state.constraint_forces, forces)
            with pytest.raises(kind, match=words):
                body.evaluate(before)
            if kind is not KeyboardInterrupt:
                with pytest.raises(kind, match="0.001, 0.002, 0.01 m" if kind is sc.InputError else words):
                    body.at([[0.001, 0.002, 0.01]], before)
            after[0] = 10**9
            assert state.solve(load_factor=0.6).residual < 1e-3
    finally:
        sc.set_thread_count(1)


def test_other_threads_run_and_a_body_is_not_asked_from_within():
    domain, nodes = block_nodes(0.007)
    base = sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))
    seen, bodies = [], []

    def energy(f):
        seen.append(threading.get_ident())
        for asked in bodies:
            with pytest.raises(sc.InputError, match="within a function of its own law"):
                asked.evaluate(np.zeros((len(nodes), 3)))
        return energy_of(LOOSE)(f)

    law = sc.Law.of_functions(energy, stress_of(LOOSE), tangent_of(LOOSE))
    body = sc.FiniteBody(domain, nodes, law, [base], body_force=[0, 0, -1e4])
    results = [None] * 3

    def solve(k):
        results[k] = sc.Equilibrium(body).solve().energy

    workers = [threading.Thread(target=solve, args=(k,)) for k in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(timeout=300)
    assert results[0] is not None and results == [results[0]] * 3 and len(set(seen)) >= 3
    bodies.append(body)
    for count in (1, 2):  # the function is called by the library's own threads too
        sc.set_thread_count(count)
        body.evaluate(np.zeros((len(nodes), 3)))
    sc.set_thread_count(1)
    bodies.clear()
    kept = weakref.ref(energy)
    del law, body, energy, solve, workers
    gc.collect()
    assert kept() is None


def test_errors_of_bodies_at_finite_strain():
    domain, nodes = block_nodes(0.009)
    law = sc.Law.neo_hookean(MU, LOOSE)
    base = sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))
    body = sc.FiniteBody(domain, nodes, law, [base])
    state = sc.Equilibrium(body)
    with pytest.raises(sc.InputError, match="coefficients: 2 rows; allowed: .* one a node"):
        body.evaluate(np.zeros((2, 3)))
    with pytest.raises(sc.InputError, match="pose of a tool, but no tool"):
        state.solve(sc.Tool.sphere_tip(0.01).pose_at([0, 0, 0.02]))
    with pytest.raises(sc.InputError, match="quasi_newton, newton"):
        sc.Equilibrium(body, method="guess")
    with pytest.raises(sc.InputError, match="prescribed displacements; the problem has"):
        state.solve(prescribed=np.zeros((1, 3)))
    with pytest.raises(sc.NumericalError, match="no equilibrium found"):
        sc.Equilibrium(sc.FiniteBody(domain, nodes, law, [base], body_force=[0, 0, -1e7]), maximum_iterations=5, halvings=1,
                       fall_back=False).solve()
    assert body.law is law and len(body.held_nodes) == len(body.prescribed) > 0
    assert body.volume == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-9)
