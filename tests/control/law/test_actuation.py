"""From the drive input to the joint motion, against Drake's dynamics."""

import dataclasses

import casadi as ca
import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from scipy.integrate import quad_vec, solve_ivp

from pfsc_drake.control.law import actuation
from pfsc_drake.control.law.actuation import DriveState
from pfsc_drake.errors import InputError

ELASTIC = "comau_racer_1_4_elastic"


def compile_law(chain, law, num_external, *arguments):
    """Return a function of state and external torques giving q-derivatives, gain, drift, offset."""
    n = chain.dimension
    state, tau_ext = ca.SX.sym("state", 4 * n), ca.SX.sym("tau_ext", n * num_external)
    measured = DriveState(*ca.vertsplit(state, n), ca.vertsplit(tau_ext, n))
    motion = law(chain, measured, *arguments)
    outputs = [ca.horzcat(*motion.q), motion.gain, motion.drift, motion.offset]
    function = ca.Function("law", [state, tau_ext], [ca.densify(e) for e in outputs])

    def evaluate(state, tau_ext):
        q, gain, drift, offset = (np.array(e) for e in function(state, np.ravel(tau_ext)))
        return q.T, gain, drift.ravel(), offset.ravel()

    return evaluate


def random_state(robot, rng):
    """Return ``[q_J, v_J, q_M, v_M]`` with joint torques well within the drives' limits."""
    n = robot.n
    q = np.array([0.2, 1.4, -0.4, 0.3, 1.1, -0.2])[:n] + rng.uniform(-0.2, 0.2, n)
    v = rng.uniform(-1.0, 1.0, n)
    stretch = 0.03 * robot.chain.gather("effort_limit") / robot.chain.K_s
    q_M = q + stretch * rng.uniform(-1.0, 1.0, n)
    return np.concatenate([q, v, q_M, v + 20.0 * stretch * rng.uniform(-1.0, 1.0, n)])


def simulate(robot, state, drive, tau_ext, end):
    """Return the plant's state after some time (may be negative) with the drive input held."""

    def rates(t, x):
        return robot.rates(x, drive, tau_ext(t))

    tight = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    return solve_ivp(rates, (0.0, end), state, dense_output=True, **tight)


def test_rigid_torque_is_inverse_dynamics(load_robot):
    robot = load_robot("comau_racer_1_4")
    evaluate = compile_law(robot.chain, actuation.rigid, 1)
    rng = np.random.default_rng(2)
    for _ in range(5):
        state, a, tau_ext = random_state(robot, rng), rng.normal(size=6), rng.normal(size=6)
        q, gain, drift, offset = evaluate(state, tau_ext)
        robot.set_state(state)
        forces = MultibodyForces(robot.plant)
        robot.plant.CalcForceElementsContribution(robot.context, forces)
        forces.mutable_generalized_forces()[:] += tau_ext
        expected = robot.plant.CalcInverseDynamics(robot.context, a, forces)
        assert np.allclose(gain @ a + drift + offset, expected, rtol=0, atol=1e-9)
        assert np.array_equal(q, state[:12].reshape(2, 6))


def test_rigid_law_on_an_elastic_robot_uses_motor_coordinates(load_robot):
    rigid, elastic = load_robot("comau_racer_1_4"), load_robot(ELASTIC)
    state = random_state(elastic, np.random.default_rng(3))
    q, gain, drift, offset = compile_law(elastic.chain, actuation.rigid, 1)(state, np.zeros(6))
    D_E, n_E = rigid.link_dynamics(*state[12:].reshape(2, 6))
    assert np.array_equal(q, state[12:].reshape(2, 6))
    assert np.allclose(gain, D_E + np.diag(elastic.chain.D_M), rtol=0, atol=1e-10)
    assert np.allclose(drift + offset, n_E, rtol=0, atol=1e-9)


def test_velocity_servo_is_the_identity(load_robot):
    chain = load_robot("comau_racer_1_4_3r").chain
    state = np.arange(12.0)
    q, gain, drift, offset = compile_law(chain, actuation.velocity_servo, 0)(state, np.zeros(0))
    assert np.array_equal(q, state[None, :3])
    assert np.array_equal(gain, np.eye(3))
    assert not np.any(drift) and not np.any(offset)


@pytest.mark.parametrize("model", [ELASTIC, "comau_racer_1_4_elastic_3r"])
def test_elastic_joint_motion_is_the_plants(load_robot, model):
    """Link acceleration and jerk from the state, and the wanted fourth derivative, in Drake."""
    robot = load_robot(model)
    n, rng = robot.n, np.random.default_rng(4)
    evaluate = compile_law(robot.chain, actuation.elastic, 3, 0.0)
    for _ in range(3):
        state, wanted = random_state(robot, rng), rng.normal(size=n) * 1e3
        external = rng.normal(size=(3, n)) * [[5.0], [50.0], [500.0]]

        def tau_ext(t, external=external):
            return external[0] + t * external[1] + 0.5 * t**2 * external[2]

        q, gain, drift, offset = evaluate(state, external)
        drive = gain @ wanted + drift + offset
        a_J = robot.rates(state, drive, external[0])[n : 2 * n]
        assert np.allclose(q[0], state[:n], rtol=0, atol=0)
        assert np.allclose(q[2], a_J, rtol=1e-9, atol=1e-9)

        h = 2e-4
        around = [a_J]
        for k in range(1, 5):
            for side in (1.0, -1.0):
                x = simulate(robot, state, drive, tau_ext, side * k * h).y[:, -1]
                around.append(robot.rates(x, drive, tau_ext(side * k * h))[n : 2 * n])
        plus, minus = np.array(around[1::2]), np.array(around[2::2])
        jerk = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280]) @ (plus - minus) / h
        snap = np.array([8 / 5, -1 / 5, 8 / 315, -1 / 560]) @ (plus + minus - 2 * a_J) / h**2
        assert np.allclose(q[3], jerk, rtol=0, atol=1e-7 * np.abs(jerk).max())
        assert np.allclose(wanted, snap, rtol=0, atol=1e-5 * np.abs(snap).max())


def test_visco_elastic_law_as_printed(load_robot):
    """(3.57) with the derivatives of Drake's matrices by finite differences, T_s = 0."""
    robot, rigid = load_robot(ELASTIC), load_robot("comau_racer_1_4")
    robot = load_robot(ELASTIC, tuple(4e-3 * robot.chain.K_s))
    K_s, K_d, D_M = robot.chain.K_s, robot.chain.K_d, robot.chain.D_M
    evaluate = compile_law(robot.chain, actuation.visco_elastic, 2, 0.0)
    rng = np.random.default_rng(5)
    for _ in range(3):
        state, jerk = random_state(robot, rng), 100.0 * rng.normal(size=6)
        external, external_rate = rng.normal(size=(2, 6)) * 10.0
        q_J, v_J, q_M, v_M = state.reshape(4, 6)
        tau_J = K_s * (q_M - q_J) + K_d * (v_M - v_J)
        D_E, n_E = rigid.link_dynamics(q_J, v_J)
        a_J = np.linalg.solve(D_E, tau_J + external - n_E)
        D_E_rate, n_E_rate = np.zeros((6, 6)), np.zeros(6)
        for k, weight in ((1, 8 / 12), (2, -1 / 12)):
            for side in (1, -1):
                t = side * k * 2e-4
                D, n = rigid.link_dynamics(q_J + t * v_J + 0.5 * t**2 * a_J, v_J + t * a_J)
                D_E_rate += side * weight * D / 2e-4
                n_E_rate += side * weight * n / 2e-4
        # the bracket of (3.57); the joint jerk is minus it, plus the drive's share
        bracket = (D_E_rate + np.diag(K_d)) @ a_J + n_E_rate - external_rate
        bracket += -K_s * (v_M - v_J) + K_d / D_M * tau_J
        expected = D_M / K_d * (D_E @ jerk + bracket)

        q, gain, drift, offset = evaluate(state, [external, external_rate])
        assert np.allclose(q[2], a_J, rtol=1e-9, atol=1e-9)
        assert np.allclose(gain, (D_M / K_d)[:, None] * D_E, rtol=0, atol=1e-10)
        drive = gain @ jerk + drift + offset
        assert np.allclose(drive, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("damping", [0.0, 10.0])
def test_visco_elastic_law_respects_the_hold(load_robot, damping):
    """At the end of the interval the joint torque's rate is the wanted one, in Drake's plant.

    Without damping but for the second order in the sampling time.
    """
    model = "comau_racer_1_4_elastic_3r"
    robot, rigid = load_robot(model, (damping,) * 3), load_robot("comau_racer_1_4_3r")
    K_s, K_d = robot.chain.K_s, robot.chain.K_d
    rng = np.random.default_rng(6)
    state, jerk = random_state(robot, rng), 100.0 * rng.normal(size=3)
    q_J, v_J, q_M, v_M = state.reshape(4, 3)
    tau_J = K_s * (q_M - q_J) + K_d * (v_M - v_J)
    D_E, n_E = rigid.link_dynamics(q_J, v_J)
    a_J = np.linalg.solve(D_E, tau_J - n_E)
    # D_E q''' + (d/dt D_E) q'' + d/dt n_E
    h, sides = 1e-4, []
    for t in (-h, h):
        D_E, n_E = rigid.link_dynamics(q_J + t * v_J + 0.5 * t**2 * a_J, v_J + t * a_J)
        sides.append(D_E @ a_J + n_E)
    wanted = rigid.link_dynamics(q_J, v_J)[0] @ jerk + (sides[1] - sides[0]) / (2 * h)
    errors = []
    for T_s in (1e-3, 5e-4, 2.5e-4):
        held = compile_law(robot.chain, actuation.visco_elastic, 2, T_s)
        _, gain, drift, offset = held(state, np.zeros(6))
        drive = gain @ jerk + drift + offset
        x = simulate(robot, state, drive, lambda t: np.zeros(3), T_s).y[:, -1]
        a_J, a_M = robot.rates(x, drive, np.zeros(3))[[3, 4, 5, 9, 10, 11]].reshape(2, 3)
        rate_at_end = K_s * (x[9:] - x[3:6]) + K_d * (a_M - a_J)
        errors.append(np.abs(rate_at_end - wanted).max())
    assert errors[0] < 1e-2 * np.abs(wanted).max()
    if damping == 0.0:
        assert np.all(np.divide(errors[:-1], errors[1:]) > 3.5)


def test_visco_elastic_hold_form_tends_to_the_printed_law(load_robot):
    robot = load_robot("comau_racer_1_4_elastic_3r", (100.0,) * 3)
    state = random_state(robot, np.random.default_rng(7))
    jerk, none = np.array([10.0, -20.0, 30.0]), np.zeros(6)
    drives = []
    for T_s in (0.0, 1e-7, 1e-8):
        _, gain, drift, offset = compile_law(robot.chain, actuation.visco_elastic, 2, T_s)(
            state, none
        )
        drives.append(gain @ jerk + drift + offset)
    far, near = np.abs(np.array(drives[1:]) - drives[0]).max(axis=1)
    assert far > 0.0
    assert np.isclose(far / near, 10.0, rtol=1e-2)


def test_elastic_law_averages_over_the_hold(load_robot):
    """Mean torque demand, against Drake's plant with the torque held.

    ``D_M K_s^-1 tau_J'' = tau_d - (D_M a_J + tau_J)``; the bracket changes during the interval.
    """
    robot = load_robot("comau_racer_1_4_elastic_3r")
    K_s, D_M = robot.chain.K_s, robot.chain.D_M
    state = random_state(robot, np.random.default_rng(8))
    wanted, none = np.array([2e3, -1e3, 3e3]), np.zeros(9)
    _, gain, drift, offset = compile_law(robot.chain, actuation.elastic, 3, 0.0)(state, none)
    now, without_hold = gain @ wanted + drift, offset
    errors, naive = [], []
    for T_s in (2e-3, 1e-3, 5e-4):
        _, gain, drift, offset = compile_law(robot.chain, actuation.elastic, 3, T_s)(state, none)
        drive = gain @ wanted + drift + offset
        motion = simulate(robot, state, drive, lambda t: np.zeros(3), T_s).sol

        def bracket(t, motion=motion, drive=drive):
            x = motion(t)
            a_J = robot.rates(x, drive, np.zeros(3))[3:6]
            return D_M * a_J + K_s * (x[6:9] - x[:3])

        mean = quad_vec(bracket, 0.0, T_s, epsabs=1e-9)[0] / T_s
        errors.append(np.abs(drive - now - mean).max())
        naive.append(np.abs(without_hold - mean).max())
    # third order with the hold, first order without
    assert errors[1] < 1e-2 * naive[1]
    assert 6.0 < errors[0] / errors[1] < 10.0
    assert 6.0 < errors[1] / errors[2] < 10.0
    assert 1.8 < naive[1] / naive[2] < 2.2


@pytest.mark.slow(but="visco_elastic")
@pytest.mark.parametrize("law", ["elastic", "visco_elastic"])
def test_damped_drives_are_averaged_over_the_hold(load_robot, law):
    """The mean motor velocity over the interval, to second order, in Drake's plant."""
    model, d = "comau_racer_1_4_elastic_3r", np.array([300.0, 200.0, 100.0])
    joints = (10.0, 8.0, 6.0) if law == "visco_elastic" else ()
    orders = {"elastic": 3, "visco_elastic": 2}[law]
    damped, free = load_robot(model, joints, tuple(d)), load_robot(model, joints)
    state = random_state(damped, np.random.default_rng(11))
    scale = {"elastic": 1e3, "visco_elastic": 10.0}[law]
    wanted, none = scale * np.array([2.0, -1.0, 3.0]), np.zeros(3 * orders)
    errors, naive = [], []
    # visco-elastic joints have a mode that decays with K_s / K_d
    for T_s in np.array([2e-3, 1e-3, 5e-4]) * {"elastic": 1.0, "visco_elastic": 0.05}[law]:
        drives = []
        for robot in (damped, free):
            evaluate = compile_law(robot.chain, getattr(actuation, law), orders, T_s)
            _, gain, drift, offset = evaluate(state, none)
            drives.append(gain @ wanted + drift + offset)
        motion = simulate(damped, state, drives[0], lambda t: np.zeros(3), T_s).sol
        mean = quad_vec(lambda t, motion=motion: d * motion(t)[9:], 0.0, T_s, epsabs=1e-9)[0] / T_s
        errors.append(np.abs(drives[0] - drives[1] - mean).max())
        naive.append(np.abs(d * state[9:] - mean).max())
    assert errors[-1] < 0.1 * naive[-1]
    assert np.all(np.divide(errors[:-1], errors[1:]) > 3.0)


def test_damping_of_drives_adds_what_it_takes_of_the_mean_velocity(load_robot):
    """``d (v_M + T_s/2 a_M)`` with the motor acceleration of the free law, for any jerk."""
    model, d, T_s = "comau_racer_1_4_elastic_3r", np.array([300.0, 200.0, 100.0]), 1e-3
    joints, jerk = (10.0, 8.0, 6.0), 1e3 * np.array([2.0, -1.0, 3.0])
    damped, free = load_robot(model, joints, tuple(d)), load_robot(model, joints)
    state = random_state(damped, np.random.default_rng(12))
    drives = []
    for robot in (damped, free):
        evaluate = compile_law(robot.chain, actuation.visco_elastic, 2, T_s)
        q, gain, drift, offset = evaluate(state, np.zeros(6))
        drives.append(gain @ jerk + drift + offset)
    chain = free.chain
    v_J, v_M, D_M, K = state[3:6], state[9:], chain.D_M, chain.K_d + chain.K_s * T_s
    tau_J_rate = (gain @ jerk + drift - T_s / 2 * D_M * jerk) / (D_M / K + T_s / 2)
    a_J = q[2] + T_s / 2 * jerk
    a_M = a_J + (tau_J_rate - chain.K_s * (v_M - v_J)) / K
    np.testing.assert_allclose(drives[0] - drives[1], d * (v_M + T_s / 2 * a_M), rtol=1e-9)


def test_rigid_joints_among_elastic_ones(load_robot):
    """Each joint by itself: a rigid one as in the rigid robot, an elastic one by its motor."""
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    links = [
        dataclasses.replace(link, stiffness=k)
        for link, k in zip(chain.links, (3.5e4, np.inf, 1.9e4), strict=True)
    ]
    mixed = dataclasses.replace(chain, links=tuple(links))
    assert not mixed.is_elastic and not mixed.is_rigid
    q, v, q_M, v_M = np.random.default_rng(2).uniform(-1, 1, (4, 3))
    q_M[1], v_M[1] = q[1], v[1]
    state, damping = np.concatenate([q, v, q_M, v_M]), np.array([0.02, 0.5, 0.03])
    motion, *law = compile_law(mixed, actuation.rigid, 1)(state, np.zeros(3))
    assert np.array_equal(motion, [q_M, v_M])
    expected = compile_law(chain, actuation.rigid, 1)(state, np.zeros(3))[1:]
    for got, value in zip(law, expected, strict=True):
        assert np.allclose(got, value, rtol=0, atol=1e-12)
    drives = [
        compile_law(robot, actuation.singular_perturbation, 1, damping)(state, np.zeros(3))
        for robot in (mixed, chain)
    ]
    fast = damping * chain.K_s * (v_M - v)
    assert fast[1] == 0.0 and np.abs(fast[[0, 2]]).min() > 1.0
    assert np.allclose(drives[0][3], drives[1][3], rtol=0, atol=1e-9)
    with pytest.raises(InputError, match=r"rigid are motor_2; laws for this robot: .*perturbation"):
        compile_law(mixed, actuation.elastic, 3, 0.0)


def test_extrapolation_makes_the_held_law_second_order(load_robot):
    """Mean of q^(4) over the second of two intervals, the same value wanted in both."""
    robot = load_robot("comau_racer_1_4_elastic_3r")
    start = random_state(robot, np.random.default_rng(9))
    wanted, none = np.array([2e3, -1e3, 3e3]), np.zeros(9)
    errors = {True: [], False: []}
    for T_s in (1e-3, 5e-4, 2.5e-4):
        evaluate = compile_law(robot.chain, actuation.elastic, 3, T_s)
        for extrapolated, error in errors.items():
            state, last_varying_input = start, None
            for _ in range(2):
                q, gain, drift, offset = evaluate(state, none)
                held = gain @ wanted + drift
                lead = (
                    0.5 * (held - last_varying_input)
                    if extrapolated and last_varying_input is not None
                    else 0.0
                )
                drive, last_varying_input = held + lead + offset, held
                state = simulate(robot, state, drive, lambda t: np.zeros(3), T_s).y[:, -1]
            jerk_after = evaluate(state, none)[0][3]
            error.append(np.abs((jerk_after - q[3]) / T_s - wanted).max())
    ratios = {key: np.divide(error[:-1], error[1:]) for key, error in errors.items()}
    # four or more at every halving, where without it is two
    assert np.all(ratios[True] > 3.5)
    assert np.all(np.abs(ratios[False] - 2.0) < 0.4)


@pytest.mark.parametrize(
    ("law", "arguments"),
    [
        (actuation.elastic, (0.0,)),
        (actuation.visco_elastic, (1e-3,)),
        (actuation.singular_perturbation, (np.ones(3),)),
    ],
)
def test_rigid_joints_are_refused_by_elastic_laws(load_robot, law, arguments):
    chain = load_robot("comau_racer_1_4_3r").chain
    with pytest.raises(InputError, match=rf"law '{law.__name__}'.*rigid are joint_1, joint_2"):
        compile_law(chain, law, 3, *arguments)


def test_a_torque_that_leads_makes_the_rigid_law_second_order(load_robot):
    """Velocity after the second of two intervals, on the way to a motion that is known."""
    robot, n = load_robot("comau_racer_1_4_3r"), 3
    rng = np.random.default_rng(4)
    q_0, amplitude, rate = np.array([0.2, 1.4, -0.4]), rng.uniform(0.1, 0.3, n), 5.0
    tau_ext = np.array([3.0, -8.0, 5.0])

    def wanted(t):
        angle = rate * t + np.array([0.3, 1.0, 2.0])
        rates = rate * np.cos(angle), -(rate**2) * np.sin(angle)
        return q_0 + amplitude * np.sin(angle), *(amplitude * value for value in rates)

    errors = {True: [], False: []}
    for T_s in (2e-3, 1e-3, 5e-4):
        for changes, error in errors.items():

            def law(chain, state, changes=changes):
                return actuation.rigid(chain, state, changes=changes)

            evaluate = compile_law(robot.chain, law, 1)
            last = None
            for k in range(2):
                # exactly on the motion at both ticks
                q, v, a = wanted(k * T_s)
                state = np.concatenate([q, v, q, v])
                _, gain, drift, offset = evaluate(state, tau_ext)
                held = gain @ a + drift
                lead = 0.5 * (held - last) if changes and last is not None else 0.0
                drive, last = held + lead + offset, held
            after = simulate(robot, state, drive, lambda t: tau_ext, T_s).y[n : 2 * n, -1]
            error.append(np.abs(after - wanted(2 * T_s)[1]).max() / T_s)
    ratios = {key: np.divide(error[:-1], error[1:]) for key, error in errors.items()}
    assert np.all(ratios[True] > 3.5)
    assert np.all(np.abs(ratios[False] - 2.0) < 0.4)
    assert errors[True][-1] < 0.05 * errors[False][-1]
