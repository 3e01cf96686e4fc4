"""Impedance filters against closed forms, matrix exponentials and an independent solver."""

import math
from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from pfsc_drake.control.compliance.impedance import ImpedanceStatus, transition
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed
from tests.control.compliance.impedance_on_numbers import ImpedanceOnNumbers

PERIOD = 1e-3
POSITION, POSE = (PathManifold(2, oriented=o).coordinates for o in (False, True))
# Tab. 3.2, mass, damping, stiffness
TANGENTIAL, TRANSVERSAL = (0.3, 300.0, 3000.0), (0.3, 122.47, 500.0)


def constant(m, d, k):
    return CoordinateImpedance(Profile(m), Profile(d), Profile(k))


def make_law(tangential=TANGENTIAL, transversal=TRANSVERSAL, r=2, period=PERIOD, **options):
    parameters = ImpedanceParameters(constant(*tangential), constant(*transversal))
    return ImpedanceOnNumbers(parameters, POSITION, r, period, **options)


def on_numbers(profile, revolution=None):
    """Return a profile as a function of arrays."""
    x = ca.SX.sym("x")
    function = ca.Function("profile", [x], [profile.interpolant(revolution)(x)])
    return lambda values: function(ca.DM(np.atleast_2d(values))).full().ravel()


def numbers(damping, stiffness, time):
    return [float(x) for x in solution(time)(damping, stiffness)]


@cache
def solution(time):
    rates = [ca.SX.sym("damping"), ca.SX.sym("stiffness")]
    return ca.Function("solution", rates, transition(*rates, time))


def by_exponential(damping, stiffness, time):
    """Return what `transition` does, from the exponential of the system with its input."""
    E = expm(np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, 1.0], [0.0, 0.0, 0.0]]) * time)
    return np.array([E[0, 0], E[0, 1], E[1, 0], E[1, 1], E[0, 2]])


def response(t, m, d, k):
    """Return the deflection after a unit step of force, from rest."""
    h, square = d / 2 / m, (d / 2 / m) ** 2 - k / m
    if k == 0.0:
        return t / d - m / d**2 * (1 - np.exp(-d / m * t)) if d else t**2 / 2 / m
    if abs(square) < 1e-9:
        return (1 - (1 + h * t) * np.exp(-h * t)) / k
    w = np.sqrt(complex(square))
    p, q = -h + w, -h - w
    return ((1 + (q * np.exp(p * t) - p * np.exp(q * t)) / (p - q)) / k).real


@pytest.mark.parametrize(
    "parameters",
    [TANGENTIAL, TRANSVERSAL, (0.5, 20, 200), (2, 6, 900), (0.1, 0, 400), (3, 40, 0), (1.5, 0, 0)],
    ids=["tangential", "transversal", "critical", "under", "undamped", "no stiffness", "free"],
)
def test_a_force_step_gives_the_closed_form(parameters):
    law, zeros, motion = make_law(parameters, parameters), np.zeros((3, 3)), []
    state = law.start(zeros[:2])
    for _ in range(400):
        state, _ = law.update(state, zeros, np.full(3, 7.0), state[3:])
        motion.append(state[0])
    expected = 7.0 * response(PERIOD * np.arange(1, 401), *parameters)
    atol = 1e-12 * np.abs(expected).max()
    assert np.allclose(motion, expected[:, None] * np.ones(3), rtol=1e-11, atol=atol)


@settings(max_examples=200, deadline=None)
@given(st.floats(-6.0, 1.0), st.floats(-6.0, 1.0))
def test_the_transition_is_the_matrix_exponential(log_damping, log_stiffness):
    """Any damping ratio; the numbers are scaled to T = 1, which is no restriction."""
    rates = (10.0**log_damping, 10.0**log_stiffness, 1.0)
    assert np.allclose(numbers(*rates), by_exponential(*rates), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("damping", [1e-9, 0.3, 0.99, 1.01, 4.0, 20.0])
def test_critical_damping_is_nothing_special(damping):
    for detune in (0.0, 1e-14, -1e-14, 1e-8, -1e-8, 1e-3, -1e-3):
        rates = (damping, damping**2 / 4 * (1 + detune), 1.0)
        assert np.allclose(numbers(*rates), by_exponential(*rates), rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("parameters", [TANGENTIAL, TRANSVERSAL])
def test_table_3_2_is_exact_at_one_millisecond(parameters):
    """An explicit Euler step would just stop a motion with d/m = 1000 1/s within one period."""
    m, d, k = parameters
    a, b, c, e, p = numbers(d / m, k / m, PERIOD)
    assert np.allclose([a, b, c, e, p], by_exponential(d / m, k / m, PERIOD), rtol=2e-14, atol=0)
    w = math.sqrt(d**2 / 4 / m**2 - k / m)
    trace = 2.0 * math.exp(-d / 2 / m * PERIOD) * math.cosh(w * PERIOD)
    assert [a + e, a * e - b * c] == pytest.approx([trace, math.exp(-d / m * PERIOD)], rel=1e-13)
    assert e > 0.3


@pytest.mark.slow
def test_moving_references_and_changing_parameters():
    """Against a solver; parameters change with every tick, the reference is of degree 4."""
    rng = np.random.default_rng(4)
    polynomials = [np.polynomial.Polynomial(rng.uniform(-1, 1, 5)) for _ in range(3)]

    def desired(t):
        return np.array([[p.deriv(k)(t) if k else p(t) for p in polynomials] for k in range(5)])

    law = make_law(r=2, desired_order=4)
    start = desired(0.0)[:2] + rng.uniform(-0.01, 0.01, (2, 3))
    state, motion = law.start(start), start.ravel()
    for i in range(100):
        impedance = np.array([[0.3 + 2e-3 * i] * 3, [300.0 - 2 * i, 5.0 + i, 0.0], [40.0 * i] * 3])
        force = rng.uniform(-20, 20, 3)

        def rates(t, x, impedance=impedance, force=force):
            y, v, y_d = x[:3], x[3:], desired(t)
            m, d, k = impedance
            return np.concatenate([v, y_d[2] + (force - d * (v - y_d[1]) - k * (y - y_d[0])) / m])

        span = (i * PERIOD, (i + 1) * PERIOD)
        motion = solve_ivp(rates, span, motion, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        state, _ = law.update(state, desired(span[0]), force, impedance)
    assert np.allclose(state[:2].ravel(), motion, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("order", "damped", "free"), [(2, 3e-5, 6e-3), (3, 6e-8, 3e-5), (4, 7e-11, 2e-8)]
)
def test_how_well_a_reference_is_extrapolated(order, damped, free):
    """Without force y_p is y_d, but for what its Taylor polynomial misses; 1 m at 5 rad/s."""
    law = make_law((1.0, 0.0, 0.0), r=2, desired_order=order)

    def desired(t):
        return np.array([[5.0**k * math.sin(5.0 * t + k * math.pi / 2)] * 3 for k in range(5)])

    state, worst = law.start(desired(0.0)[:2]), np.zeros(3)
    for i in range(1000):
        worst = np.maximum(worst, np.abs(state[0] - desired(i * PERIOD)[0]))
        state, _ = law.update(state, desired(i * PERIOD)[: order + 1], np.zeros(3), state[3:])
    assert np.all(worst < [free, damped, damped])


@pytest.mark.parametrize(
    "parameters", [TANGENTIAL, TRANSVERSAL, (1.0, 0.0, 500.0), (2.0, 5.0, 0.0), (1.0, 0.0, 0.0)]
)
def test_passivity(parameters):
    """The work of the force is the change of the stored energy and what damping takes."""
    m, d, k = parameters
    law, rng = make_law(parameters, parameters), np.random.default_rng(1)
    state, desired = law.start(rng.uniform(-0.1, 0.1, (2, 3))), np.zeros((3, 3))
    for _ in range(300):
        force = rng.uniform(-30.0, 30.0, 3)
        after, _ = law.update(state, desired, force, state[3:])
        work = force * (after[0] - state[0])
        stored = m / 2 * (after[1] ** 2 - state[1] ** 2) + k / 2 * (after[0] ** 2 - state[0] ** 2)
        assert np.all(work - stored >= -1e-11)
        assert d or np.allclose(work, stored, rtol=1e-9, atol=1e-12)
        state = after


def test_no_step_whatever_changes():
    """y_p, y_p' at a tick are those the last interval ended with; the next starts with them."""
    law, brief = make_law(desired_order=4), make_law(desired_order=4, period=1e-13)
    rng = np.random.default_rng(2)
    state = law.start(np.array([[0.5, 0.01, -0.02], [0.4, 0.1, -0.1]]))
    for _ in range(50):
        desired = rng.uniform(-1, 1, (5, 3))
        impedance = 10.0 ** rng.uniform([[-1], [-2], [0]], [[1], [2], [4]], (3, 3))
        force = rng.uniform(-100.0, 100.0, 3)
        assert np.array_equal(law.reference(state, desired)[:2], state[:2])
        shortly_after, _ = brief.update(state, desired, force, impedance)
        moved = np.abs(shortly_after[:2] - state[:2])
        assert moved[0].max() < 1e-12 * (1 + np.abs(state[:2]).max())
        assert moved[1].max() < 1e-6
        state, _ = law.update(state, desired, force, impedance)


@pytest.mark.parametrize("r", [1, 2, 3, 4])
def test_derivatives(r):
    """Rows 2..r are the derivatives at the end of the interval."""
    law = make_law((2.0, 6.0, 900.0), (1.0, 30.0, 50.0), r=r, response_order=r)
    rng = np.random.default_rng(r)
    state = law.start(rng.uniform(-0.1, 0.1, (2, 3)))
    desired = rng.uniform(-1, 1, (law.desired_order + 1, 3))
    force = rng.uniform(-5, 5, 3)
    state, _ = law.update(state, desired, force, state[3:])
    weights = [law.period**k / math.factorial(k) for k in range(len(desired))]
    # term by term: how np.dot rounds depends on the processor
    moved = [
        sum(w * row for w, row in zip(weights, rows, strict=False))
        for rows in (desired, desired[1:])
    ]
    later = np.vstack([moved, desired[2:]])
    reference = law.reference(state, later)
    for i, (m, d, k) in enumerate([(2.0, 6.0, 900.0), (1.0, 30.0, 50.0), (1.0, 30.0, 50.0)]):
        system = np.array([[0.0, 1.0, 0.0], [-k / m, -d / m, force[i] / m], [0.0, 0.0, 0.0]])
        e = np.array([*(state[:2, i] - later[:2, i]), 1.0])
        for j in range(r + 1):
            expected = later[j, i] + (np.linalg.matrix_power(system, j) @ e)[0]
            assert reference[j, i] == pytest.approx(expected, rel=1e-12, abs=1e-12)
    low = make_law((2.0, 6.0, 900.0), (1.0, 30.0, 50.0), r=r).reference(state, later)
    assert np.array_equal(low[:3], reference[:3])
    assert np.array_equal(low[3:], later[3 : r + 1])


def follow(response_order):
    """Return the error of a loop of r = 4, poles at -50 1/s, over the static deflection."""
    law = make_law(r=4, response_order=response_order)
    chain = np.diag(np.ones(4), 1)
    step, gains = expm(chain * PERIOD)[:4], np.poly([-50.0] * 4)[:0:-1]
    state, y, errors = law.start(np.zeros((2, 3))), np.zeros((4, 3)), []
    for _ in range(500):
        reference = law.reference(state, np.zeros((5, 3)))
        errors.append(y[0, 0] - reference[0, 0])
        v = reference[4] - gains @ (y - reference[:4])
        y = step @ np.vstack([y, v])
        state, _ = law.update(state, np.zeros((5, 3)), np.full(3, 10.0), state[3:])
    assert abs(errors[-1]) < 1e-5
    return np.abs(errors).max() / (10.0 / 3000.0)


def test_an_elastic_loop_must_not_be_fed_with_jumping_derivatives():
    assert follow(4) > 8.0
    assert follow(2) < 0.14


def test_inputs_that_cannot_be_used():
    law, zeros, rng = make_law(), np.zeros((3, 3)), np.random.default_rng(5)
    state = law.start(rng.uniform(-1, 1, (2, 3)))
    free_motion, _ = law.update(state, zeros, np.zeros(3), state[3:])
    for value in (np.nan, np.inf, -np.inf):
        after, status = law.update(state, zeros, np.array([5.0, value, 1.0]), state[3:])
        assert status == ImpedanceStatus.FORCE_NOT_FINITE
        assert np.array_equal(after, free_motion)
    for row, value in ((0, 0.0), (0, np.inf), (1, -1.0), (1, np.inf), (2, -1.0), (2, np.nan)):
        impedance = state[3:].copy()
        impedance[row, 1] = value
        after, status = law.update(state, zeros, np.zeros(3), impedance)
        assert status == ImpedanceStatus.IMPEDANCE_NOT_VALID
        assert np.array_equal(after, free_motion)
    after, status = law.update(state, zeros + np.nan, np.zeros(3), state[3:])
    assert status == ImpedanceStatus.REFERENCE_NOT_FINITE
    assert np.array_equal(after[:2], [state[0], np.zeros(3)])


def test_infinite_stiffness_is_position_control():
    """A coordinate is rigid exactly, whatever its state; released, it goes on from y_d."""
    parameters = ImpedanceParameters(transversal=constant(*TRANSVERSAL))
    law, rng = ImpedanceOnNumbers(parameters, POSE, 4, PERIOD), np.random.default_rng(6)
    state = law.start(rng.uniform(-1, 1, (2, 6)))
    desired, rigid = rng.uniform(-1, 1, (5, 6)), [0, 3, 4, 5]
    assert np.array_equal(law.reference(state, desired)[:, rigid], desired[:, rigid])
    state, _ = law.update(state, desired, np.full(6, 50.0), state[3:])
    weights = [law.period**k / math.factorial(k) for k in range(len(desired))]
    # term by term: how np.dot rounds depends on the processor
    moved = [
        sum(w * row for w, row in zip(weights, rows, strict=False))
        for rows in (desired, desired[1:])
    ]
    later = np.vstack([moved, desired[2:]])
    reference = law.reference(state, later)
    assert np.array_equal(reference[:, rigid], later[:, rigid])
    assert np.abs(reference - later)[:3, 1:3].min() > 1e-6
    state[5] = 100.0
    assert np.array_equal(law.reference(state, later)[:2, rigid], later[:2, rigid])


def test_profiles():
    profile = Profile(over="xi", at=[0.0, 0.01, 0.03, 0.04], values=[5.0, 0.0, 0.0, 80.0])
    value = on_numbers(profile)
    assert value([-1.0, *profile.at, 2.0]) == pytest.approx([5, 5, 0, 0, 80, 80])
    x = np.linspace(-0.01, 0.05, 60001)
    y = value(x)
    assert y.min() == 0.0
    assert np.all(np.diff(y)[x[1:] <= 0.01] <= 0.0)
    assert np.all(np.diff(y)[x[:-1] >= 0.01] >= 0.0)
    assert np.abs(np.diff(y, 2)).max() < 1e-3 * np.abs(np.diff(y)).max()
    assert np.isnan(value(np.nan))
    kinds = CoordinateImpedance(
        Profile(1.0), profile, Profile(over="eta", at=[1, 2], values=[3, 9])
    )
    law = ImpedanceOnNumbers(ImpedanceParameters(kinds, kinds, kinds), POSE, 2, PERIOD)
    impedance = law.impedance(np.array([1.5, 0.024, -0.032, 1.0, 1.0, 1.0]))
    assert np.allclose(impedance, np.array([[1.0], [80.0], [6.0]]) * np.ones(6))
    kinds.mass.value = 0.0
    with pytest.raises(InputError, match="mass"):
        ImpedanceOnNumbers(ImpedanceParameters(kinds), POSITION, 2, PERIOD)


def test_profiles_go_round_closed_paths():
    revolution = 2.5
    profile = Profile(over="eta", at=[0.5, 1.0, 2.0], values=[3.0, 9.0, 1.0])
    value = on_numbers(profile, revolution)
    eta = np.linspace(-3.0, 6.0, 2001)
    around = value(eta)
    np.testing.assert_allclose(value(eta + 2 * revolution), around, atol=1e-12)
    for at, expected_value in zip(profile.at, profile.values, strict=True):
        assert value(at) == pytest.approx(expected_value)
        assert value(at - revolution) == pytest.approx(expected_value)
    # from the last breakpoint to the first of the next lap it goes straight up, without a step
    seam = value(np.linspace(2.0, 3.0, 200))
    assert np.all(np.diff(seam) >= 0.0)
    assert np.abs(np.diff(around)).max() < 0.2
    slopes = np.gradient(around, eta)
    assert np.abs(np.diff(slopes)).max() < 1.0
    # one that names both ends of the lap
    whole = on_numbers(
        Profile(over="eta", at=[0.0, 1.0, revolution], values=[3.0, 9.0, 3.0]), revolution
    )
    assert whole(revolution + 1.0) == pytest.approx(9.0)
    with pytest.raises(InputError, match=r"2\.5 m long"):
        Profile(at=[0.0, 2.6], values=[1.0, 1.0]).interpolant(revolution)
    with pytest.raises(InputError, match="the last must be the first"):
        Profile(at=[0.0, 2.5], values=[1.0, 2.0]).interpolant(revolution)


def test_an_impedance_goes_round_closed_paths():
    soft = CoordinateImpedance(
        Profile(1.0), Profile(1.0), Profile(over="eta", at=[0.2, 1.0], values=[100.0, 900.0])
    )
    parameters = ImpedanceParameters(constant(*TANGENTIAL), soft)
    law = ImpedanceOnNumbers(parameters, POSITION, 2, PERIOD, revolution=2.0)
    straight = ImpedanceOnNumbers(parameters, POSITION, 2, PERIOD)
    y, later = np.array([0.6, 0.0, 0.0]), np.array([2.6, 0.0, 0.0])
    np.testing.assert_allclose(law.impedance(y), law.impedance(later), rtol=1e-12)
    assert straight.impedance(later)[2, 1] == 900.0
    assert 100.0 < law.impedance(later)[2, 1] < 900.0


def over(what):
    soft = CoordinateImpedance(damping=Profile(over=what, at=[0.0, 1.0], values=[1.0, 2.0]))
    return ImpedanceParameters(transversal=soft)


def test_profiles_over_a_single_coordinate():
    law = ImpedanceOnNumbers(over("xi_2"), POSITION, 2, 1e-3)
    damping = law.impedance(np.array([9.0, 9.0, 1.0]))[1]
    assert np.array_equal(damping, [0.0, 2.0, 2.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Profile(-1.0), "value = -1.0"),
        (
            lambda: ImpedanceOnNumbers(over("theta"), POSITION, 2, 1e-3),
            "compliance.transversal.damping.over: 'theta'; must be one of eta, xi_1, xi_2, xi",
        ),
        (lambda: Profile(at=[0.0, 0.0], values=[1.0, 2.0]), "at: .* increasing"),
        (lambda: CoordinateImpedance(mass=Profile(0.0)), "mass: .* positive"),
        (lambda: CoordinateImpedance(damping=Profile(math.inf)), "damping: inf"),
        (lambda: make_law(r=5), "relative_degree: 5; must be 1 to 4"),
        (lambda: make_law(r=3, desired_order=2), "desired_order: 2; must be 3 or more"),
    ],
)
def test_errors(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_parameters_come_from_yaml():
    kind = {"mass": {"value": 0.3}, "damping": {"at": [0, 1], "values": [1, 2]}}
    data = {"tangential": kind | {"stiffness": {"value": 0.0}}}
    loaded = load_typed(ImpedanceParameters, data, "compliance.yaml")
    assert loaded.tangential.damping.values == [1.0, 2.0]
    assert math.isinf(loaded.transversal.stiffness.value)
    with pytest.raises(InputError, match=r"compliance.yaml: .*tangential.*stiffness"):
        load_typed(ImpedanceParameters, {"tangential": kind}, "compliance.yaml")
