"""The one place that inverts a decoupling matrix."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.law import decoupling
from pfsc_drake.control.law.decoupling import (
    DecouplingInverse,
    DecouplingSolution,
    Restraint,
    Spare,
)
from pfsc_drake.errors import InputError


def on_numbers(expression, *arrays):
    """Return an expression's results, of arrays that it is not built with."""
    symbols = [None if x is None else ca.SX.sym("x", *np.shape(x)) for x in arrays]
    results = expression(*symbols)
    kept = [i for i, x in enumerate(results) if x is not None]
    given = [(symbol, x) for symbol, x in zip(symbols, arrays, strict=True) if x is not None]
    function = ca.Function("f", [s for s, _ in given], [ca.densify(results[i]) for i in kept])
    values = iter(function.call([x for _, x in given]))
    shaped = (np.array(next(values)) if i in kept else None for i in range(len(results)))
    return [x if x is None or x.shape[1] > 1 else x.ravel() for x in shaped]


def solve(inverse, A, rhs, spare=None):
    """Return the solution of numbers."""

    def expression(A, rhs, desired, scale, slope, rate, rest, velocity):
        if desired is None:
            return inverse.solve(A, rhs)
        held = None
        if rest is not None:
            held = Restraint(rest, velocity, *spare.restraint[2:])
        return inverse.solve(A, rhs, Spare(desired, scale, slope, rate, held))

    spare = spare or Spare(None, rate=None)
    restraint = spare.restraint or Restraint(None, None, 0.0, None)
    parts = on_numbers(expression, A, rhs, *spare[:4], restraint.rest, restraint.velocity)
    x, rcond, usable, residual, rest = parts
    return DecouplingSolution(x, rcond.item(), bool(usable.item()), residual, rest)


def scale_of(W):
    """Return the weight's root as numbers."""
    return on_numbers(lambda W: [decoupling.scale_of(W)], W)[0]


def free_torque(A, torque, scale=None):
    """Return the free torque as numbers."""
    return on_numbers(lambda *x: [decoupling.free_torque(*x)], A, torque, scale)[0]


def test_solution_and_condition_match_numpy():
    rng = np.random.default_rng(1)
    inverse = DecouplingInverse()
    for n in (3, 6):
        for _ in range(20):
            A, rhs = rng.normal(size=(n, n)), rng.normal(size=n)
            solution = solve(inverse, A, rhs)
            condition = np.linalg.cond(A, 1)
            assert np.allclose(solution.x, np.linalg.solve(A, rhs), rtol=1e-11 * condition)
            assert solution.rcond == pytest.approx(1.0 / condition, rel=1e-9)
            assert not solution.residual.any()


@pytest.mark.parametrize("A", [np.zeros((3, 3)), np.diag([1.0, 0.0, 1.0])])
def test_a_singular_matrix_is_not_accepted(A):
    inverse = DecouplingInverse(1e-12)
    solution = solve(inverse, A, np.ones(3))
    assert np.all(np.isnan(solution.x))
    assert solution.rcond == 0.0
    assert not solution.usable


def test_a_nearly_singular_matrix_is_not_accepted():
    inverse = DecouplingInverse(1e-12)
    A = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
    assert not solve(inverse, A, np.ones(3)).usable


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_matrix_that_is_not_finite_is_not_accepted(bad):
    A = np.eye(3)
    A[1, 2] = bad
    inverse = DecouplingInverse()
    assert not solve(inverse, A, np.ones(3)).usable


def test_the_limit_of_the_condition_number():
    # A diagonal matrix's reciprocal condition number is the ratio of its extremes
    A, rhs = np.diag([1.0, 0.5, 0.01]), np.ones(3)
    assert solve(DecouplingInverse(0.009), A, rhs).usable
    assert not solve(DecouplingInverse(0.011), A, rhs).usable


@pytest.mark.parametrize("min_rcond", [0.0, 1.0, -1.0, np.nan])
def test_the_limit_must_lie_between_zero_and_one(min_rcond):
    with pytest.raises(InputError, match="min_rcond"):
        DecouplingInverse(min_rcond)


def redundant(seed, m=6, n=7):
    """Return a matrix of more columns than rows, a right side, a desired value, a weight's root."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    weight = root @ root.T + np.eye(n)
    return rng.normal(size=(m, n)), rng.normal(size=m), rng.normal(size=n), weight


@pytest.mark.parametrize("size", [(6, 7), (3, 6), (5, 6)])
@pytest.mark.parametrize("weighted", [False, True])
def test_the_solution_next_to_a_wish_is_the_weighted_least_squares_one(size, weighted):
    for seed in range(10):
        A, rhs, desired, W = redundant(seed, *size)
        W_inv = np.linalg.inv(W) if weighted else np.eye(size[1])
        scale = scale_of(W) if weighted else None
        solution = solve(DecouplingInverse(), A, rhs, Spare(desired, scale))
        expected = desired + W_inv @ A.T @ np.linalg.solve(A @ W_inv @ A.T, rhs - A @ desired)
        assert np.allclose(solution.x, expected, rtol=1e-10, atol=1e-11)
        # conditioning is that of A, whatever the weight
        frobenius = np.linalg.norm(A) * np.linalg.norm(np.linalg.pinv(A))
        assert solution.rcond == pytest.approx(len(A) / frobenius, rel=1e-9)
        assert not solution.residual.any()


def test_the_root_of_a_weight():
    _, _, _, W = redundant(3)
    scale = scale_of(W)
    assert np.allclose(scale @ scale.T, np.linalg.inv(W), rtol=1e-10)
    assert np.isnan(np.diag(scale_of(-np.eye(3)))).all()


@pytest.mark.parametrize("weighted", [False, True])
def test_a_spare_coordinate_gets_its_rate_and_the_outputs_theirs(weighted):
    A, rhs, desired, W = redundant(5, 3, 6)
    slope, scale = np.arange(1.0, 7.0), scale_of(W) if weighted else None
    plain = solve(DecouplingInverse(), A, rhs, Spare(desired, scale)).x
    x = solve(DecouplingInverse(), A, rhs, Spare(desired, scale, slope, 0.7)).x
    assert np.allclose(A @ x, rhs, atol=1e-12)
    assert slope @ x == pytest.approx(0.7, abs=1e-12)
    # of all that do both it is nearest to the one without
    W = W if weighted else np.eye(6)
    null = np.linalg.svd(np.vstack([A, slope]))[2][4:]
    assert np.allclose(null @ W @ (x - plain), 0.0, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 1e-6, 0.01, 0.5])
def test_a_coordinate_that_the_outputs_fix_is_given_up_smoothly(share):
    A, rhs, desired, _ = redundant(6)
    free, fixed = np.linalg.svd(A)[2][-1], A[0] / np.linalg.norm(A[0])
    slope = share * free + np.sqrt(1.0 - share**2) * fixed
    x = solve(DecouplingInverse(), A, rhs, Spare(desired, None, slope, 100.0)).x
    assert np.allclose(A @ x, rhs, atol=1e-9)
    plain = solve(DecouplingInverse(), A, rhs, Spare(desired)).x
    missing = 100.0 - slope @ plain
    gain = share / max(share**2, 1e-2)
    assert np.allclose(x - plain, gain * missing * free, atol=1e-8)


def test_free_torques_do_no_work_on_the_outputs():
    A, _, torque, W = redundant(7, 3, 7)
    W_inv = np.linalg.inv(W)
    N = np.eye(7) - W_inv @ A.T @ np.linalg.solve(A @ W_inv @ A.T, A)
    assert np.allclose(free_torque(A, torque, scale_of(W)), N.T @ torque, atol=1e-12)
    assert np.allclose(free_torque(A, A.T @ np.ones(3)), 0.0, atol=1e-12)
    free = np.linalg.svd(A)[2][-1]
    assert np.allclose(free_torque(A, free), free, atol=1e-12)


@pytest.mark.parametrize("spare", [True, False])
def test_damping_bounds_the_solution_and_tells_what_is_missed(spare):
    n = 7 if spare else 6
    rng = np.random.default_rng(8)
    u, _, v = np.linalg.svd(rng.normal(size=(6, n)), full_matrices=False)
    rhs, desired = rng.normal(size=6), Spare(np.zeros(n)) if spare else None
    inverse = DecouplingInverse(1e-3, 0.1)
    for smallest in (0.0, 1e-9, 1e-3, 0.02):
        A = u @ np.diag([1.0, 0.9, 0.8, 0.7, 0.6, smallest]) @ v
        solution = solve(inverse, A, rhs, desired)
        assert solution.usable
        assert np.allclose(rhs - A @ solution.x, solution.residual, atol=1e-10)
        # lambda is at least 0.05, and x at most |rhs| / (2 lambda)
        assert np.linalg.norm(solution.x) < np.linalg.norm(rhs) / (2.0 * 0.05)
        undamped = solve(DecouplingInverse(1e-14), A, rhs, desired)
        if smallest == 1e-9:
            assert not np.linalg.norm(undamped.x) < 1e6


@pytest.mark.parametrize("size", [0.2, 1.0, 30.0])
def test_damping_is_least_squares_with_a_weight_that_follows_the_matrix(size):
    """``min |A x - rhs|^2 + lambda^2 |x|^2`` as one system, whatever the matrix's units."""
    A = size * np.array([[1.0, 0.4, 0.0], [0.9, 0.41, 0.01], [0.0, 0.3, 1.0]])
    rhs, c_0 = size * np.array([0.3, -0.2, 0.5]), 0.2
    solution = solve(DecouplingInverse(1e-6, c_0), A, rhs)
    assert 0.0 < solution.rcond < c_0
    weight = np.sqrt((c_0**2 - solution.rcond**2) * np.sum(A**2))
    stacked = np.vstack([A, weight * np.eye(3)])
    expected = np.linalg.lstsq(stacked, np.concatenate([rhs, np.zeros(3)]), rcond=None)[0]
    np.testing.assert_allclose(solution.x, expected, rtol=1e-9)


@pytest.mark.parametrize("spare", [True, False])
def test_damping_sets_in_continuously(spare):
    n, desired = (7, Spare(np.zeros(7))) if spare else (6, None)
    rng = np.random.default_rng(9)
    A, rhs = rng.normal(size=(6, n)), rng.normal(size=6)
    # one that is looked at for damping and needs none
    plain = solve(DecouplingInverse(1e-4, 1e-3), A, rhs, desired)
    just = solve(DecouplingInverse(1e-4, plain.rcond * (1.0 + 1e-9)), A, rhs, desired)
    assert just.residual.any()
    assert not plain.residual.any()
    assert np.allclose(just.x, plain.x, rtol=1e-5)
    above = solve(DecouplingInverse(1e-4, plain.rcond * (1.0 - 1e-9)), A, rhs, desired)
    assert np.array_equal(above.x, plain.x)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("damped_below", [0.0, 0.1])
def test_what_is_not_finite_is_refused_with_joints_to_spare(bad, damped_below):
    A, rhs, desired, _ = redundant(10)
    inverse = DecouplingInverse(1e-3, damped_below)
    A[2, 3] = bad
    assert not solve(inverse, A, rhs, Spare(desired)).usable
    assert not solve(DecouplingInverse(1e-3), np.zeros((6, 7)), rhs, Spare(desired)).usable


@pytest.mark.parametrize("damped_below", [1e-3, 1.0, -0.1, np.nan])
def test_damping_begins_above_the_limit(damped_below):
    with pytest.raises(InputError, match="damped_below"):
        DecouplingInverse(1e-3, damped_below)


def held_back(
    settling,
    speeds,
    velocity=True,
    scale=None,
    slope=None,
    damped_below=0.0,
    seed=5,
    to_ends=None,
):
    """Return matrix, right-hand side, velocity, spare motion, and the solution."""
    rng = np.random.default_rng(seed)
    A, rhs, desired = rng.normal(size=(4, 7)), rng.normal(size=4), 50.0 * rng.normal(size=7)
    v = rng.normal(size=7) if velocity else None
    restraint = Restraint(-5.0 * v if velocity else np.zeros(7), v, settling, speeds, to_ends)
    spare = Spare(desired, scale, slope, 30.0, restraint)
    return A, rhs, v, spare, solve(DecouplingInverse(damped_below=damped_below), A, rhs, spare)


@pytest.mark.parametrize("scale", [None, np.diag(np.linspace(0.5, 2.0, 7))])
@pytest.mark.parametrize("slope", [None, np.arange(7.0)])
def test_joints_that_may_be_as_fast_as_they_like_are_not_held_back(scale, slope):
    A, rhs, _, spare, solution = held_back(3.0, np.full(7, np.inf), scale=scale, slope=slope)
    free = solve(DecouplingInverse(), A, rhs, spare._replace(restraint=None))
    np.testing.assert_allclose(solution.x, free.x, rtol=1e-12)


@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("scale", [None, np.diag(np.linspace(0.5, 2.0, 7))])
def test_joints_become_as_fast_as_they_may_and_outputs_stay(velocity, scale):
    """The velocity for the outputs is the weighted least-norm part of it."""
    settling, speeds = (3.0 if velocity else 1.0), np.full(7, 5.0)
    A, rhs, v, spare, solution = held_back(settling, speeds, velocity, scale)
    np.testing.assert_allclose(A @ solution.x, rhs, atol=1e-12)
    W = np.eye(7) if scale is None else np.linalg.inv(scale @ scale.T)
    right = np.linalg.inv(W) @ A.T @ np.linalg.inv(A @ np.linalg.inv(W) @ A.T)
    rest = spare.restraint.rest + right @ (rhs - A @ spare.restraint.rest)
    np.testing.assert_allclose(solution.rest, rest, atol=1e-12)
    taken = np.abs(right @ (A @ v) if velocity else rest)
    reached = (taken + np.abs(solution.x - rest) / settling) / speeds
    assert reached.max() == pytest.approx(1.0)
    far = spare.desired + right @ (rhs - A @ spare.desired) - rest
    assert np.abs(np.cross((solution.x - rest)[:3], far[:3])).max() < 1e-9  # the same way
    assert (taken + np.abs(far) / settling).max() > 2.0 * speeds[0]


def test_outputs_that_need_all_the_speed_leave_none():
    _, _, _, _, solution = held_back(3.0, np.full(7, 1e-3))
    np.testing.assert_array_equal(solution.x, solution.rest)


@pytest.mark.parametrize("velocity", [True, False])
def test_joints_come_to_rest_before_their_ends_and_outputs_stay(velocity):
    settling, free = (3.0 if velocity else 1.0), np.full(7, np.inf)
    A, rhs, v, _, far = held_back(settling, free, velocity)
    asked = (far.x - far.rest) / settling
    taken = np.linalg.pinv(A) @ (A @ v) if velocity else far.rest
    for joint in range(7):
        # 0.7 of what is asked, the way it goes, and at its end the other way
        to_ends = np.full((7, 2), np.inf)
        out, back = (0, 1) if asked[joint] > 0.0 else (1, 0)
        to_ends[joint, out] = np.sign(asked[joint]) * taken[joint] + 0.7 * abs(asked[joint])
        to_ends[joint, back] = -1.0
        _, _, _, _, held = held_back(settling, free, velocity, to_ends=ca.SX(to_ends))
        np.testing.assert_allclose(A @ held.x, rhs, atol=1e-12)
        np.testing.assert_allclose(held.x - held.rest, 0.7 * (far.x - far.rest), atol=1e-10)
        # past its end it is not led on, and not kept from going back
        past = np.where(np.isfinite(to_ends), -100.0, np.inf)
        _, _, _, _, held = held_back(settling, free, velocity, to_ends=ca.SX(past))
        np.testing.assert_array_equal(held.x, held.rest)
        past[joint, out] = np.inf
        _, _, _, _, held = held_back(settling, free, velocity, to_ends=ca.SX(past))
        np.testing.assert_allclose(held.x, far.x, rtol=1e-12)


def test_what_damping_misses_is_told_of_joints_that_are_held_back():
    for speeds in (np.full(7, 5.0), np.full(7, np.inf)):
        A, rhs, _, _, solution = held_back(3.0, speeds, damped_below=0.9)
        assert solution.residual.any()
        np.testing.assert_allclose(rhs - A @ solution.x, solution.residual, atol=1e-10)
