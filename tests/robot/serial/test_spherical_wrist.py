"""The inverse kinematics against the direct kinematics, branch by branch."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydrake.math import RotationMatrix

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.parameters import load_parameters
from pfsc_drake.robot.serial.denavit_hartenberg import DenavitHartenberg
from pfsc_drake.robot.serial.spherical_wrist import SphericalWrist

COMAU = load_parameters("comau_racer_1_4")
TABLE = COMAU.denavit_hartenberg.table()
LIMITS = (COMAU.joint_limits.position_lower, COMAU.joint_limits.position_upper)
FREE = (np.full(6, -np.pi), np.full(6, np.pi))
TOOL = COMAU.tool.tool_point

angles = st.lists(st.floats(-np.pi, np.pi), min_size=6, max_size=6).map(np.array)
fractions = st.lists(st.floats(0, 1), min_size=6, max_size=6).map(np.array)


def wrist(limits=LIMITS, tool_offset=TOOL) -> SphericalWrist:
    return SphericalWrist(TABLE, *limits, tool_offset)


def zyz(phi: float, theta: float, psi: float) -> np.ndarray:
    """Rotation by ZYZ Euler angles, (2.6)."""
    z1, y, z2 = (
        RotationMatrix.MakeZRotation(phi),
        RotationMatrix.MakeYRotation(theta),
        RotationMatrix.MakeZRotation(psi),
    )
    return (z1 @ y @ z2).matrix()


def angle_error(q: np.ndarray, reference: np.ndarray) -> np.ndarray:
    return np.abs((q - reference + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


def distance_from_singularity(q: np.ndarray) -> float:
    """Smallest of: sine at wrist and elbow, distance of the wrist centre from axis 1 [m]."""
    wrist_centre = TABLE.link_poses(q)[4][:3, 3]
    bend = q[2] + np.arctan2(TABLE.a[2], TABLE.d[3]) + np.pi / 2
    return min(abs(np.sin(q[4])), abs(np.sin(bend)), np.hypot(*wrist_centre[:2]))


def assert_reaches(q: np.ndarray, y_t: np.ndarray, R_e: np.ndarray, tolerance: float) -> None:
    y_found, R_found = TABLE.pose(q, TOOL)
    np.testing.assert_allclose(y_found, y_t, atol=tolerance)
    np.testing.assert_allclose(R_found, R_e, atol=tolerance)


@settings(max_examples=200, deadline=None)
@given(angles)
def test_every_branch_reaches_the_pose_and_one_is_the_original(q):
    assume(distance_from_singularity(q) > 1e-3)
    y_t, R_e = TABLE.pose(q, TOOL)
    found = wrist(FREE).solutions(y_t, R_e)
    assert len(found) in (4, 8)
    for solution in found:
        assert_reaches(solution, y_t, R_e, 1e-11)
    assert angle_error(found, q).min() < 1e-8
    different = [angle_error(found[:i], found[i]).min() for i in range(1, len(found))]
    assert min(different) > 1e-6


@settings(max_examples=100, deadline=None)
@given(angles)
def test_reaches_the_pose_also_at_and_near_singularities(q):
    y_t, R_e = TABLE.pose(q, TOOL)
    for solution in wrist(FREE).solutions(y_t, R_e, preference=q):
        assert_reaches(solution, y_t, R_e, 1e-8)


@settings(max_examples=100, deadline=None)
@given(fractions)
def test_closest_returns_the_reference_within_the_limits(fraction):
    lower, upper = LIMITS
    q = lower + fraction * (upper - lower)
    assume(distance_from_singularity(q) > 1e-3)
    y_t, R_e = TABLE.pose(q, TOOL)
    found = wrist().closest(y_t, R_e, q)
    np.testing.assert_allclose(found, q, atol=1e-8)
    assert np.all((lower <= found) & (found <= upper))
    assert np.all((wrist().solutions(y_t, R_e) >= lower) & (wrist().solutions(y_t, R_e) <= upper))


def test_pose_of_the_vertical_paraboloid_experiment():
    # (4.53): the tool points forward and up; sigma_r = [0, pi/4, pi - 0.1] are ZYZ angles
    arm = wrist(tool_offset=np.zeros(3))
    found = arm.solutions([0.83, 0.0, 0.9], zyz(0.0, np.pi / 4, np.pi - 0.1))
    expected = np.deg2rad([0.0, 96.0, -32.3, 0.0, 71.4, -5.7])
    assert angle_error(found, expected).min() < np.deg2rad(0.06)
    # front, elbow up, theta_5 > 0 comes first
    assert angle_error(found[0], expected) < np.deg2rad(0.06)


def test_closest_makes_full_turns_that_the_limits_allow():
    limits = (np.full(6, -3 * np.pi), np.full(6, 3 * np.pi))
    q = np.array([0.3, 1.2, -0.3, 0.4, 0.9, 0.5])
    turned = q + 2 * np.pi * np.array([0, 0, 0, 1, 0, -1])
    found = wrist(limits).closest(*TABLE.pose(q, TOOL), turned)
    np.testing.assert_allclose(found, turned, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_closest_is_the_best_of_all_branches_and_full_turns(seed):
    rng = np.random.default_rng(seed)
    limits = (np.full(6, -1.2 * np.pi), np.full(6, 1.6 * np.pi))
    y_t, R_e = TABLE.pose(rng.uniform(-np.pi, np.pi, 6), TOOL)
    reference = rng.uniform(-2 * np.pi, 2 * np.pi, 6)
    best = np.inf
    for solution in wrist(FREE).solutions(y_t, R_e):
        # the joints are independent: the nearest admissible turn of each
        turns = solution[:, np.newaxis] + 2 * np.pi * np.arange(-3, 4)
        allowed = (turns >= limits[0][:, np.newaxis]) & (turns <= limits[1][:, np.newaxis])
        miss = np.where(allowed, np.abs(turns - reference[:, np.newaxis]), np.inf).min(axis=1)
        best = min(best, np.sum(miss**2))
    found = wrist(limits).closest(y_t, R_e, reference)
    assert_reaches(found, y_t, R_e, 1e-11)
    np.testing.assert_allclose(np.sum((found - reference) ** 2), best, rtol=1e-8)


def test_closest_at_the_seam_of_a_full_turn():
    q = np.array([0.3, 1.2, -0.3, np.pi, 0.9, -np.pi])
    found = wrist().closest(*TABLE.pose(q, TOOL), q)
    np.testing.assert_allclose(found, q, atol=1e-8)


def test_wrist_singularity_takes_theta_4_from_the_preference():
    q = np.array([0.3, 1.2, -0.3, 0.4, 0.0, 0.5])
    y_t, R_e = TABLE.pose(q, TOOL)
    np.testing.assert_allclose(wrist().closest(y_t, R_e, q), q, atol=1e-9)
    other = q + np.array([0, 0, 0, 0.8, 0, 0])
    expected = q + np.array([0, 0, 0, 0.8, 0, -0.8])
    np.testing.assert_allclose(wrist().closest(y_t, R_e, other), expected, atol=1e-9)


def test_folded_wrist_takes_theta_4_from_the_preference():
    q = np.array([0.3, 1.2, -0.3, 0.4, np.pi, 0.5])
    limits = (np.full(6, -3.5), np.full(6, 3.5))
    np.testing.assert_allclose(wrist(limits).closest(*TABLE.pose(q, TOOL), q), q, atol=1e-9)


def test_wrist_centre_on_axis_1_takes_theta_1_from_the_preference():
    arm = wrist(FREE)
    above_base = np.array([0.0, 0.0, 1.3])
    R_e = zyz(0.2, 0.6, 0.1)
    y_t = above_base + R_e @ (TOOL + np.array([0.0, 0.0, TABLE.d[5]]))
    for theta_1 in (0.0, 1.0):
        found = arm.solutions(y_t, R_e, preference=[theta_1, 0, 0, 0, 0, 0])
        assert len(found) == 4
        np.testing.assert_allclose(found[:, 0], theta_1, atol=1e-12)
        for solution in found:
            assert_reaches(solution, y_t, R_e, 1e-12)


def test_out_of_reach_names_distance_and_reach():
    with pytest.raises(InputError, match=r"must be 0\.1062 to 1\.2862 m") as caught:
        wrist().solutions([3.0, 0.0, 0.43], np.eye(3))
    # the wrist centre is 0.22 m below the shoulder, 2.85 m in front of it or 3.15 m behind it
    for horizontal in (2.85, 3.15):
        assert f"{np.hypot(horizontal, 0.22):.4f}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_violated_limits_name_joint_value_and_range():
    q = np.deg2rad([0.0, 90.0, 0.0, 0.0, -150.0, 0.0])
    with pytest.raises(InputError, match=r"theta_\d = -?\d+\.\d\d deg: must be -?\d+ to") as caught:
        wrist().solutions(*TABLE.pose(q, TOOL))
    assert "branches violate a limit" in str(caught.value)


def test_limits_missed_by_rounding_count_as_reached():
    q = np.array([0.2, LIMITS[1][1], -0.4, 0.3, 0.8, -0.2])
    found = wrist().closest(*TABLE.pose(q, TOOL), q)
    np.testing.assert_allclose(found, q, atol=1e-8)
    assert found[1] <= LIMITS[1][1]


@pytest.mark.parametrize(
    ("y_t", "R_e", "message"),
    [
        ([0.8, 0.0], np.eye(3), "y_t"),
        ([0.8, 0.0, np.inf], np.eye(3), "y_t"),
        ([0.8, 0.0, 0.9], np.diag([1.0, 1.0, -1.0]), "rotation matrix"),
        ([0.8, 0.0, 0.9], 2 * np.eye(3), "rotation matrix"),
    ],
)
def test_refuses_what_is_no_pose(y_t, R_e, message):
    with pytest.raises(InputError, match=message):
        wrist().solutions(y_t, R_e)


def test_refuses_other_structures():
    d, a, alpha = TABLE.d.copy(), TABLE.a.copy(), TABLE.alpha.copy()
    with pytest.raises(InputError, match="DH alpha"):
        SphericalWrist(DenavitHartenberg(d, a, -alpha), *LIMITS, TOOL)
    d[4] = 0.1
    with pytest.raises(InputError, match=r"DH d_5 = 0\.1 m: must be 0"):
        SphericalWrist(DenavitHartenberg(d, a, alpha), *LIMITS, TOOL)
    with pytest.raises(InputError, match="lower limits"):
        SphericalWrist(TABLE, LIMITS[1], LIMITS[0], TOOL)
