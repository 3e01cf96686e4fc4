"""Space as a manifold: coordinates against motions of a tool, forces against their power."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import manifold_force_function
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.jets import Jet

QUATERNION = np.array([0.2, 0.5, -0.7, 0.4]) / np.linalg.norm([0.2, 0.5, -0.7, 0.4])
KINDS = {
    "none": {},
    "all": {"quaternion": QUATERNION},
    "axis": {"quaternion": QUATERNION, "tool_axis": [0.3, -0.2, 1.0]},
    "euler zyx": {"quaternion": QUATERNION, "euler": "zyx"},
    "euler zyz": {"quaternion": QUATERNION, "euler": "zyz"},
    "turn": {"quaternion": QUATERNION, "yaw_axis": [0.0, 0.0, 1.0]},
}


def outputs(manifold, point, y_t, R_e, twist):
    """The virtual output and its rate, shape (2, m)."""
    spin = np.cross(np.eye(3), twist[3:])
    y, R = Jet([ca.SX(y_t), ca.SX(twist[:3])]), Jet([ca.SX(R_e), ca.SX(spin @ R_e)])
    jets = manifold.virtual_output(y, R, ca.SX(point), [])
    return np.array([[float(ca.evalf(x.coefficients[k])) for x in jets] for k in (0, 1)])


@pytest.mark.parametrize("kind", KINDS)
def test_rates_are_difference_quotients_and_forces_their_power(kind):
    manifold, rng = SpaceManifold(1, **KINDS[kind]), np.random.default_rng(3)
    y_t, step = np.array([0.8, -0.1, 0.9]), 1e-6
    R_e = (
        quaternion_to_matrix(QUATERNION[None])[0]
        @ Rotation.from_euler("ZYX", [0.3, -0.4, 0.2]).as_matrix()
    )
    if kind == "turn":  # a tool with the reference's tilt
        R_d = quaternion_to_matrix(QUATERNION[None])[0]
        R_e = Rotation.from_rotvec([0.0, 0.0, 0.6]).as_matrix() @ R_d
    point, function = manifold.point(y_t), manifold_force_function(manifold)
    for _ in range(4):
        twist, wrench = rng.uniform(-0.4, 0.4, 6), rng.uniform(-20, 20, 6)
        here, rates = outputs(manifold, point, y_t, R_e, twist)
        later = Rotation.from_rotvec(step * twist[3:]).as_matrix() @ R_e
        there = outputs(manifold, point, y_t + step * twist[:3], later, twist)[0]
        np.testing.assert_allclose((there - here) / step, rates, atol=1e-5)
        tau = np.array(function(wrench, point, here)).ravel()
        acting = wrench.copy()
        if kind == "none":
            acting[3:] = 0.0
        if manifold.tool.tool_axis is not None:
            about = R_e @ manifold.tool.tool_axis
            acting[3:] -= about * (about @ wrench[3:])
        if kind == "turn":
            acting[3:5] = 0.0
        assert tau @ rates == pytest.approx(acting @ twist, abs=1e-10)


def test_coordinates_are_those_of_the_world():
    manifold = SpaceManifold(2, QUATERNION)
    assert [c.kind for c in manifold.coordinates] == [Kind.TANGENTIAL] * 3 + [Kind.ROTATIONAL] * 3
    R_d = quaternion_to_matrix(QUATERNION[None])[0]
    still = outputs(manifold, manifold.point([1, 2, 3]), [1, 2, 3], R_d, np.zeros(6))[0]
    np.testing.assert_allclose(still, [1, 2, 3, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(manifold.orientation(manifold.point([1, 2, 3])[None])[0], R_d)
    assert manifold.layout.size == manifold.point([1, 2, 3]).size


def test_an_axis_needs_an_orientation():
    with pytest.raises(InputError, match="the space has no orientation"):
        SpaceManifold(1, tool_axis=[0.0, 0.0, 1.0])
