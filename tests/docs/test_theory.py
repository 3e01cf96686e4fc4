"""Formulas of docs/theory, evaluated as printed there and compared with the code.

Every test names the page and the label of what it evaluates.
"""

import math
import re
from collections import Counter
from functools import wraps
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from pfsc_drake import jets
from pfsc_drake.control.compliance.impedance import transition
from pfsc_drake.control.compliance.impedance_parameters import SlowEnds
from pfsc_drake.control.compliance.tuned_impedance import tolerable_inertia_error
from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.control.fixtures.guidance import approach_speed
from pfsc_drake.control.law import actuation
from pfsc_drake.control.law.actuation import DriveState, joint_jets
from pfsc_drake.control.law.decoupling import DecouplingInverse, Spare
from pfsc_drake.control.law.laws import ActuationOptions
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.robust_gains import RobotError, SampledRobot
from pfsc_drake.control.law.stabilization import LoopGains, Stabilization, gains_from_poles
from pfsc_drake.control.manifolds.forces import force_along_surface, tangent_plane
from pfsc_drake.control.manifolds.path import PathGeometry, PathManifold, path_parameter
from pfsc_drake.control.manifolds.surface import surface_parameters
from pfsc_drake.geometry import FourierCurve, SurfacePointLayout
from pfsc_drake.geometry import Path as Track
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import joint_resonances
from tests.control.conftest import Robot
from tests.control.fixtures.program_on_numbers import NearRegion, ProgramOnNumbers

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "theory"
_LABEL = re.compile(r"^\$\$ \(([a-z-]+)\)$", re.MULTILINE)
_REFERENCE = re.compile(r"\{eq\}`([a-z-]+)`")
MODEL = "comau_racer_1_4_elastic_3r"


def numbers(*expressions):
    """Return arrays of expressions without symbols."""
    return [np.squeeze(ca.evalf(ca.SX(e)).full()) for e in expressions]


def mass_matrix(robot, q):
    return np.array(ca.evalf(robot.mass_matrix(ca.SX(q))))


@pytest.fixture(name="arm", scope="module")
def fixture_arm():
    return Robot(MODEL)


def of(page, labels):
    """See that what a test evaluates stands on its page."""

    def decorate(test):
        @wraps(test)
        def checked(*args, **kwargs):
            text = (FOLDER / f"{page}.md").read_text(encoding="utf-8")
            assert set(labels.split()) <= set(_LABEL.findall(text))
            return test(*args, **kwargs)

        return checked

    return decorate


def test_labels_are_unique_and_references_lead_somewhere():
    pages = [path.read_text(encoding="utf-8") for path in FOLDER.glob("*.md")]
    labels = Counter(label for text in pages for label in _LABEL.findall(text))
    assert set(labels.values()) == {1}
    assert {name for text in pages for name in _REFERENCE.findall(text)} <= set(labels)
    assert all(text.count("\n$$ (") * 2 == len(re.findall(r"^\$\$", text, re.M)) for text in pages)


@of("jets", "jets-sine jets-composition")
def test_sine_is_its_own_composition():
    x, s, c = [0.7, 0.3, -0.2, 0.5, 0.1], [math.sin(0.7)], [math.cos(0.7)]
    for k in range(1, 5):
        s.append(sum(j * x[j] * c[k - j] for j in range(1, k + 1)) / k)
        c.append(-sum(j * x[j] * s[k - j] for j in range(1, k + 1)) / k)
    slopes = [math.sin(0.7 + n * math.pi / 2.0) for n in range(5)]
    for found in (jets.sin(Jet(x)), jets.compose(slopes, Jet(x))):
        np.testing.assert_allclose(found.coefficients, s, rtol=0, atol=1e-15)


@of("manifolds", "manifolds-alpha manifolds-theta")
def test_path_parameter():
    """The recursion, with polynomials of numpy in place of jets."""
    random = np.random.default_rng(1)
    sigma = FourierCurve.bent_lemniscate().derivatives(0.9, 5)
    slope, bend = sigma[1], sigma[2]
    offset = np.cross(slope, [0.1, 0.2, 0.3])
    y = np.vstack([sigma[0] + 0.05 * offset, random.normal(size=(4, 3)) * 0.1])
    alpha = (y[0] - sigma[0]) @ bend / (slope @ slope)
    theta = [0.0]
    for k in range(1, 5):
        at = Polynomial([*theta, 0.0])
        powers = [at**n / math.factorial(n) for n in range(5)]
        F = Polynomial([0.0])
        for axis in range(3):
            place, along = (sum(sigma[n + i, axis] * powers[n] for n in range(5)) for i in (0, 1))
            F += (Polynomial(y[:, axis]) - place) * along
        theta.append(F.coef[k] / (slope @ slope * (1.0 - alpha)))
    path = PathGeometry(ca.SX(0), ca.SX(3, 1), [ca.SX(row) for row in sigma], [])
    found = path_parameter(Jet([ca.SX(row) for row in y]), path)
    np.testing.assert_allclose(numbers(*found.coefficients), theta, rtol=1e-12)


def paraboloid(u, v):
    """Return the partial derivatives up to order 2 of (u, v, u^2 + u v / 2 - v^2)."""
    first = [[1.0, 0.0, 2.0 * u + v / 2.0], [0.0, 1.0, u / 2.0 - 2.0 * v]]
    second = [[0.0, 0.0, bend] for bend in (2.0, 0.5, -2.0)]
    return np.array([[u, v, u * u + u * v / 2.0 - v * v], *first, *second])


def plane_of(partials):
    """Return the tangent plane of a surface."""
    layout = SurfacePointLayout(1, False)
    point = np.zeros(layout.size)
    point[layout.position] = partials.ravel()
    return tangent_plane(ca.SX(point), layout)


@of("manifolds", "manifolds-hessian manifolds-theta-surface manifolds-sigma")
def test_surface_parameters_and_lengths():
    s, s_1, s_2, s_11, s_12, s_22 = partials = paraboloid(0.2, -0.1)
    normal = np.cross(s_1, s_2)
    normal /= np.linalg.norm(normal)
    d, rate = 0.08 * normal, np.array([0.3, -0.2, 0.5])
    slopes = np.array([s_1, s_2])
    first = slopes @ slopes.T
    H = first - np.array([[d @ s_11, d @ s_12], [d @ s_12, d @ s_22]])
    found = surface_parameters(Jet([ca.SX(s + d), ca.SX(rate)]), [ca.SX(p) for p in partials])
    np.testing.assert_allclose(
        numbers(*[theta.coefficients[1] for theta in found]), np.linalg.solve(H, slopes @ rate)
    )
    (Sigma,) = numbers(plane_of(partials).Sigma)
    np.testing.assert_allclose(Sigma.T @ Sigma, first, atol=1e-15)
    assert Sigma[1, 1] == pytest.approx(np.linalg.norm(np.cross(s_1, s_2)) / np.linalg.norm(s_1))


@of("compliance", "compliance-forces")
def test_force_along_a_surface():
    *_, s_11, s_12, s_22 = partials = paraboloid(0.2, -0.1)
    xi, f, plane = 0.08, np.array([3.0, -2.0, 5.0]), plane_of(partials)
    axes, Sigma, L = numbers(plane.axes, plane.Sigma, plane.curvature)
    d = xi * axes[:, 2]
    H = Sigma.T @ Sigma - np.array([[d @ s_11, d @ s_12], [d @ s_12, d @ s_22]])
    inverse, along = np.linalg.inv(Sigma), axes[:, :2].T @ f
    (tau,) = numbers(force_along_surface(ca.SX(f), plane, xi))
    np.testing.assert_allclose(tau[:2], inverse.T @ H @ inverse @ along)
    np.testing.assert_allclose(tau[:2], (np.eye(2) - xi * L) @ along)
    assert tau[2] == pytest.approx(axes[:, 2] @ f)


@of("law", "law-motion law-desired-torque law-elastic-hold law-visco-hold law-visco-implicit")
@pytest.mark.parametrize("law", ["rigid", "singular_perturbation", "visco_elastic", "elastic"])
def test_drive_torques(law, arm):
    robot, n, T = arm.chain, arm.n, 1e-3
    random = np.random.default_rng(3)
    q, v = np.array([0.2, 2.0, -0.2]), random.normal(size=n)
    q_M, v_M = q + 1e-3 * random.normal(size=n), v + 0.05 * random.normal(size=n)
    tau_ext = list(random.normal(size=(3, n)))
    top = random.normal(size=n) * 50.0
    K_s, K_d, D_M, d_v = robot.K_s, robot.K_d, robot.D_M, robot.viscous_damping
    D_E, zero = mass_matrix(robot, q), np.zeros(n)

    def c(*motion):
        """Return the derivative of the inverse dynamics in which the last order is zero."""
        tau = robot.inverse_dynamics(joint_jets([ca.SX(x) for x in (*motion, zero)]))
        (found,) = numbers(ca.vertcat(*[t.derivative(len(motion) - 2) for t in tau]))
        return found

    state = DriveState(*(ca.SX(x) for x in (q, v, q_M, v_M)), [ca.SX(t) for t in tau_ext])
    if law == "rigid":
        expected = (
            (mass_matrix(robot, q_M) + np.diag(D_M)) @ top + c(q_M, v_M) - tau_ext[0] + d_v * v_M
        )
        motion = actuation.rigid(robot, state)
    elif law == "singular_perturbation":
        eps_D_b = np.array([0.02, 0.02, 0.01])
        expected = (D_E + np.diag(D_M)) @ top + c(q, v) - tau_ext[0] + d_v * v_M
        expected -= eps_D_b * K_s * (v_M - v)
        motion = actuation.singular_perturbation(robot, state, eps_D_b)
    elif law == "visco_elastic":
        tau_J = K_s * (q_M - q) + K_d * (v_M - v)
        a_J = np.linalg.solve(D_E, tau_J + tau_ext[0] - c(q, v))
        wanted = D_E @ top + c(q, v, a_J) - tau_ext[1]
        mean = a_J + T / 2.0 * top
        a_M = (wanted - K_s * (v_M - v) + (K_d + K_s * T) * mean) / (K_d + K_s * T)
        D_v = D_M + T / 2.0 * d_v
        expected = D_v * a_M + tau_J + T / 2.0 * wanted + d_v * v_M
        motion = actuation.visco_elastic(robot, state, T)
    else:
        tau_J, rate = K_s * (q_M - q), K_s * (v_M - v)
        a_J = np.linalg.solve(D_E, tau_J + tau_ext[0] - c(q, v))
        jerk = np.linalg.solve(D_E, rate + tau_ext[1] - c(q, v, a_J))
        wanted = D_E @ top + c(q, v, a_J, jerk) - tau_ext[2]
        expected = ((D_M + T / 2.0 * d_v) / K_s + T**2 / 6.0) * wanted + T**2 / 6.0 * D_M * top
        expected += D_M * (a_J + T / 2.0 * jerk) + tau_J + T / 2.0 * rate
        expected += d_v * (v_M + T / 2.0 * a_J)
        motion = actuation.elastic(robot, state, T)
    (found,) = numbers(motion.gain @ top + motion.drift + motion.offset)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@of("redundancy", "redundancy-inverse redundancy-damped")
@pytest.mark.parametrize("damped_below", [0.0, 0.9])
def test_right_inverse(damped_below):
    random = np.random.default_rng(5)
    A, rhs, w = random.normal(size=(3, 5)), random.normal(size=3), random.normal(size=5)
    root = np.diag(random.uniform(0.5, 2.0, 5))
    spare = Spare(ca.SX(w), ca.SX(root))
    found = DecouplingInverse(1e-3, damped_below).solve(ca.SX(A), ca.SX(rhs), spare)
    x, residual = numbers(found.x, found.residual)
    c = 3.0 / (np.linalg.norm(A) * np.linalg.norm(np.linalg.pinv(A)))
    square = max(damped_below**2 - c**2, 0.0) * np.linalg.norm(A @ root) ** 2
    assert bool(square) == (damped_below > 0.0)
    inverse = root @ root.T
    core = np.linalg.inv(A @ inverse @ A.T + square * np.eye(3))
    np.testing.assert_allclose(x, w + inverse @ A.T @ core @ (rhs - A @ w), rtol=1e-10)
    np.testing.assert_allclose(residual, square * core @ (rhs - A @ w), atol=1e-12)


@of("compliance", "compliance-transition")
def test_impedance_over_a_tick():
    m, d, k, T = 3.0, 90.0, 5000.0, 0.02
    h, kappa = d / (2.0 * m), k / m
    w = math.sqrt(kappa - h * h)
    b = math.exp(-h * T) * math.sin(w * T) / w
    a = math.exp(-h * T) * math.cos(w * T) + h * b
    last = math.exp(-h * T) * math.cos(w * T) - h * b
    printed = [a, b, -kappa * b, last, (1.0 - a) / kappa]
    found = [float(x) for x in transition(ca.DM(d / m), ca.DM(kappa), T)]
    np.testing.assert_allclose(found, printed, rtol=1e-12)


@of("compliance", "compliance-observed")
def test_inertia_that_an_observer_believes():
    m, d, k, L = 3.0, 90.0, 5000.0, 100.0
    border = m + d / L - m * k / (k + d * L)
    assert tolerable_inertia_error(m, d, k, L) == pytest.approx(border)
    poles = np.roots([m, d + m * L - border * L, k + d * L, k * L])
    assert np.max(poles.imag) == pytest.approx(math.sqrt((k + d * L) / m))
    assert np.max(poles.real) == pytest.approx(0.0, abs=1e-9)


@of("fixtures", "fixtures-beta")
def test_braking():
    T_b, a_b, out = 0.015, 20.0, 0.02
    beta, meet = approach_speed(T_b, a_b, out), a_b * T_b**2
    assert float(beta(ca.DM(meet), 1.0)) == pytest.approx(a_b * T_b)
    for s in (-1e-7, 1e-7):
        slope = float(beta(ca.DM(meet + s), 1.0) - a_b * T_b) / s
        assert slope == pytest.approx(1.0 / T_b, rel=1e-4)
    assert float(beta(ca.DM(-1.0), 0.5)) == -0.5 * out


@of("fixtures", "fixtures-free fixtures-program fixtures-tick")
def test_energy_of_a_tick():
    """Random regions, hands and largest speeds."""
    m, T = 3.0, 1e-3
    random, program = np.random.default_rng(7), ProgramOnNumbers(T)
    checked = 0
    for _ in range(200):
        near = []
        for i in range(random.integers(1, 5)):
            n = random.normal(size=3)
            soft, u = random.random() < 0.4, random.uniform(-0.1, 0.1)
            k, depth = (3000.0, random.uniform(-2e-3, 5e-3)) if soft else (math.inf, 0.0)
            n = tuple((n / np.linalg.norm(n)).tolist())
            near.append(NearRegion(i, 0.0, n, u, random.uniform(-0.02, 0.3), k, depth))
        v, f = 0.3 * random.normal(size=3), 30.0 * random.normal(size=3)
        momentum, limit = m * v + T * f, 10.0 ** random.uniform(-5.0, 0.5)
        d = max(90.0, (np.linalg.norm(momentum) / limit - m) / T)
        free = momentum / (m + T * d)
        assert np.linalg.norm(free) <= limit * (1.0 + 1e-12)
        solution = program.solve(m + T * d, free.tolist(), near)
        if solution.squeezed:
            continue
        after, checked = np.array(solution.velocity), checked + 1
        gained = m / 2.0 * (after @ after - v @ v)
        allowed = T * f @ after - T * d * after @ after
        for region, phi in zip(near, solution.forces, strict=True):
            allowed += T * phi * region.u
            if region.stiffness < math.inf:
                gained += phi**2 / region.stiffness / 2.0
                gained -= region.stiffness * max(0.0, region.depth) ** 2 / 2.0
            else:
                allowed += T * phi * max(0.0, -region.beta)
        assert gained <= allowed + 1e-12
    assert checked > 100


@of("observers", "observers-fading")
def test_fading_memory():
    """Weighted least squares over a long past give the recursion's gains."""
    T, rate = 1e-3, 200.0
    beta = math.exp(-rate * T)
    printed = [
        [1.0 - beta],
        [1.0 - beta**2, (1.0 - beta) ** 2 / T],
        [1.0 - beta**3, 1.5 * (1.0 - beta) ** 2 * (1.0 + beta) / T, (1.0 - beta) ** 3 / T**2],
    ]
    ages = np.arange(400)
    for k, gain in enumerate(printed):
        np.testing.assert_allclose(SignalDerivatives(k, rate, T).gain, gain, rtol=1e-12)
        regressor = np.array([(-ages * T) ** j / math.factorial(j) for j in range(k + 1)]).T
        weighted = regressor.T * beta**ages
        fit = np.linalg.solve(weighted @ regressor, weighted)
        np.testing.assert_allclose(fit[:, 0], gain, rtol=1e-6)


@of("margins", "margins-omega margins-bound")
def test_what_a_loop_bears(arm):
    """The border of stability, on the law's own sampled loop, sampled fast."""
    chain, T, poles = arm.chain, 2e-5, (-25.0, -27.0, -29.0, -31.0)
    path = Track(FourierCurve.bent_lemniscate())
    y_t = path.position.derivatives(0.7, 0)[0]
    q = arm.reach(y_t, guess=(0.2, 2.0, -0.2))
    law = linearize(chain, "elastic", PathManifold(4, oriented=False), ActuationOptions(T))
    point = path.evaluator(4)(y_t.tolist(), 0.7)
    robot = SampledRobot(LoopAtRest(chain, law, RestPosture(q, point), T), T, is_elastic=True)
    gains = LoopGains(Stabilization([gains_from_poles(poles)] * 3, 4, ["x"] * 3))
    D_E = mass_matrix(chain, q)
    Omega = np.diag(chain.K_s) @ (np.diag(1.0 / chain.D_M) + np.linalg.inv(D_E))
    omega = math.sqrt(np.max(np.linalg.eigvals(Omega).real))
    assert omega == pytest.approx(np.max(joint_resonances(chain, q)))
    a_4, a_3, a_2, a_1 = np.poly(poles)[1:]

    def room(epsilon):
        return a_3 - (1.0 - epsilon) * a_2 / a_4 - a_1 * a_4 / a_2 - epsilon * omega**2

    borne = brentq(room, 0.0, 0.9)
    wrong = [RobotError(stiffness=1.0 / (1.0 - share * borne)) for share in (0.95, 1.05)]
    assert robot.rate(gains, wrong[0]) < 0.0 < robot.rate(gains, wrong[1])


@pytest.mark.parametrize(("eta", "factor"), [(0.0, 2.0), (0.5, 0.0), (1.0, 1.0)])
def test_slow_ends_as_printed(eta, factor):
    """Page errata, (5.4)."""
    damping = SlowEnds(least=90.0, most=3000.0, length=1.0).interpolant()
    assert float(damping(eta)) == pytest.approx(90.0 + factor * 2910.0, rel=1e-6)
