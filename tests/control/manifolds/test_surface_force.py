"""Forces along a surface's coordinates against virtual work, with motions and with a robot."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.manifolds.manifold import manifold_force_function
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.jets import Jet
from tests.control.manifolds.surfaces import (
    SITUATIONS,
    GivenOrientation,
    frame,
    reference_rotation,
    surface,
    surface_point,
)

DOWN = np.diag([1.0, -1.0, -1.0])
TILT = zyx_to_matrix([0.2, 0.15, -0.3])
ORIENTATIONS = {
    "none": {},
    "normal": {"orientation": "normal", "offset": DOWN @ TILT},
    "given": {"orientation": "given"},
    "axis": {"orientation": "normal", "offset": DOWN, "tool_axis": [0.0, 0.0, 1.0]},
    "axis of a given one": {"orientation": "given", "tool_axis": [0.2, -0.4, 0.3]},
    "euler": {"orientation": "normal", "offset": DOWN @ TILT, "euler": "zyx"},
    "euler of a given one": {"orientation": "given", "euler": "zyz"},
    "turn": {"orientation": "normal", "offset": DOWN, "yaw_axis": [0.1, 0.2, 1.0]},
    "turn of a given one": {"orientation": "given", "yaw_axis": [0.0, 0.0, 1.0]},
}


def place(manifold, name, rng):
    """Return a tool pose beside a surface, and the surface point there."""
    (theta, distance), geometry = SITUATIONS[name], surface(name)
    sigma, _, axes = frame(geometry, theta)
    y_t, given = sigma + distance * axes[:, 2], GivenOrientation(zyx_to_matrix([0.4, 0.1, 3.0]))
    R_e = np.eye(3)
    if len(manifold.coordinates) > 3:
        R_d = reference_rotation(manifold, geometry, theta, given)
        R_e = R_d @ Rotation.from_euler("ZYX", rng.uniform(-0.5, 0.5, 3)).as_matrix()
        if manifold.tool.yaw_axis is not None:  # the tilt is the reference's
            R_e = Rotation.from_rotvec(0.7 * manifold.tool.yaw_axis).as_matrix() @ R_d
    return y_t, R_e, surface_point(manifold, geometry, y_t, theta, given=given)


def outputs_of(manifold, point, y_t, R_e):
    """Return the virtual output and its rate, shape (2, m), as a function of the twist."""
    twist = ca.SX.sym("twist", 6)
    y, R = Jet([ca.SX(y_t), twist[:3]]), Jet([ca.SX(R_e), ca.skew(twist[3:]) @ R_e])
    jets = manifold.virtual_output(y, R, ca.SX(point), [])
    rows = [ca.horzcat(*[x.coefficients[k] for x in jets]) for k in (0, 1)]
    function = ca.Function("outputs", [twist], [ca.densify(ca.vertcat(*rows))])
    return lambda twist: function(twist).full()


def force(manifold, wrench, point, reference, **keys):
    function = manifold_force_function(manifold, **keys)
    return np.array(function(wrench, point, reference)).ravel()


@pytest.mark.slow(
    but=[
        "none-cylinder",
        "normal-saddle",
        "given-saddle",
        "axis-paraboloid",
        "axis of a given one-saddle",
        "euler-paraboloid",
        "euler of a given one-cylinder",
        "turn-saddle",
        "turn of a given one-paraboloid",
    ]
)
@pytest.mark.parametrize("name", SITUATIONS)
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_power_of_random_motions(name, orientation):
    """The rates, which other tests know to be right, times the forces; torques across an axis."""
    rng, manifold = np.random.default_rng(2), SurfaceManifold(1, **ORIENTATIONS[orientation])
    y_t, R_e, point = place(manifold, name, rng)
    outputs = outputs_of(manifold, point, y_t, R_e)
    still = outputs(np.zeros(6))[0]
    for _ in range(3):
        wrench, twist = rng.uniform(-20, 20, 6), rng.uniform(-0.3, 0.3, 6)
        rates = outputs(twist)[1]
        tau = force(manifold, wrench, point, still, with_turning=True)
        acting = wrench.copy()
        if manifold.tool.tool_axis is not None:
            about = R_e @ manifold.tool.tool_axis
            acting[3:] -= about * (about @ wrench[3:])
        if manifold.tool.yaw_axis is not None:
            acting[3:] = manifold.tool.yaw_axis * (manifold.tool.yaw_axis @ wrench[3:])
        if len(tau) == 3:
            acting[3:] = 0.0
        assert tau @ rates == pytest.approx(acting @ twist, abs=1e-11)
        if len(tau) == 3:
            continue
        # without the turning: the power relative to the orientation that moves with the tool
        fixed = np.append(twist[:3], np.zeros(3))
        omega_d = frame_velocity(outputs, len(manifold.coordinates), fixed)
        relative = acting @ np.append(twist[:3], twist[3:] - omega_d)
        tau = force(manifold, wrench, point, still)
        assert tau @ rates == pytest.approx(relative, abs=1e-11)


def frame_velocity(outputs, m, twist):
    """Return the angular velocity of ``R_d``: the turn at which the angles of a tool stand still.

    Of an axis, up to a turn about it.
    """
    turns = [np.append(np.zeros(3), unit) for unit in np.eye(3)]
    slope = np.array([outputs(turn)[1, 3:m] for turn in turns]).T
    return -np.linalg.pinv(slope) @ outputs(twist)[1, 3:m]


@pytest.mark.parametrize("orientation", ["normal", "axis", "given"])
def test_virtual_work_with_the_jacobian_of_a_robot(load_robot, orientation):
    """A' tau = J_g' wrench, with J_g from Drake."""
    robot, rng = load_robot("comau_racer_1_4"), np.random.default_rng(7)
    manifold = SurfaceManifold(2, **ORIENTATIONS[orientation])
    y_t, R_e, point = place(manifold, "paraboloid", rng)
    q = robot.reach(y_t, R_e)
    wrench = rng.uniform(-30, 30, 6)
    if manifold.tool.tool_axis is not None:
        about = R_e @ manifold.tool.tool_axis
        wrench[3:] -= about * (about @ wrench[3:])
    still = outputs_of(manifold, point, y_t, R_e)(np.zeros(6))[0]
    tau = force(manifold, wrench, point, still, with_turning=True)
    A = np.array(decoupling_function(robot.chain, manifold)(q, point))
    joint_torques = robot.jacobian(q).T @ np.concatenate([wrench[3:], wrench[:3]])
    assert np.allclose(A.T @ tau, joint_torques, rtol=0, atol=1e-8)


def test_half_way_to_the_axis_of_a_cylinder_the_force_around_it_is_half():
    manifold = SurfaceManifold(1)
    _, _, point = place(manifold, "cylinder", np.random.default_rng(0))
    around, along, normal = manifold.axes(point).full().T
    wrench = np.append(3.0 * around + 5.0 * along + 7.0 * normal, np.zeros(3))
    tau = force(manifold, wrench, point, [0.3, 0.1, 0.125])
    assert tau == pytest.approx([1.5, 5.0, 7.0], abs=1e-12)
    # where the tool is to be counts
    on_surface = force(manifold, wrench, point, [0.3, 0.1, 0.0])
    assert on_surface == pytest.approx([3.0, 5.0, 7.0], abs=1e-12)


def test_what_is_not_finite_stays_so():
    manifold = SurfaceManifold(1, orientation="normal")
    _, _, point = place(manifold, "saddle", np.random.default_rng(0))
    tau = force(manifold, np.full(6, np.nan), point, np.zeros(6), with_turning=True)
    assert np.isnan(tau).all()
    nowhere = np.full_like(point, np.nan)
    assert np.isnan(force(manifold, np.ones(6), nowhere, np.zeros(6), with_turning=True)).all()
    assert np.isnan(manifold.axes(nowhere).full()).all()
