"""Position, orientation and force of a teleoperated tool."""

import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.fixtures.contact_program import SLOTS
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord
from pfsc_drake.control.teleoperation.commanded_point import (
    CommandedOrientation,
    CommandedPoint,
    FixtureReaction,
)
from pfsc_drake.robot.robot_model import pose_function
from tests.diagrams.conftest import Arm


def record(point, slots, regions=2):
    layout = GuidanceRecord(regions)
    row = np.zeros(layout.size)
    near = np.zeros((SLOTS, len(SLOT)))
    near[:, 0] = -1.0
    for k, (number, normal, force) in enumerate(slots):
        near[k, 0], near[k, 2:5], near[k, SLOT.index("phi")] = number, normal, force
    row[layout.fields["point"]] = point
    row[layout.fields["near"]] = near.ravel()
    return row


def test_regions_and_environment_are_felt_together():
    stepper = Stepper(FixtureReaction(2), ("wrench",))
    slots = [(0, (0.0, 0.0, 1.0), 7.0), (1, (0.6, 0.8, 0.0), 5.0)]
    row = stepper.step(record=record([0.1, 0.2, 0.3], slots), wrench=[1, 0, -2, 9, 9, 9])
    np.testing.assert_allclose(row["felt"], [1 + 3.0, 4.0, 5.0], atol=1e-12)
    np.testing.assert_allclose(row["position"], [0.1, 0.2, 0.3])


def test_the_force_of_a_guide_is_felt():
    """2 kN/m, 3 mm beside the guide."""
    layout = GuideRecord(3)
    guides = np.zeros(layout.size)
    guides[layout.fields["kappa"]], guides[layout.fields["foot"]] = 2e3, [0.1, 0.2, 0.303]
    row = Stepper(FixtureReaction(2, num_guides=3)).step(
        record=record([0.1, 0.2, 0.3], []), guides=guides
    )
    np.testing.assert_allclose(row["felt"], [0.0, 0.0, 6.0], atol=1e-9)


def test_nan_keeps_the_last_position():
    stepper = Stepper(FixtureReaction(2))
    stepper.step(record=record([0.1, 0.2, 0.3], []))
    row = stepper.step(record=np.full(GuidanceRecord(2).size, np.nan))
    np.testing.assert_allclose(row["position"], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(row["felt"], 0.0)


def test_position_of_a_tool_on_a_path_includes_the_lag():
    """``y + lag y'``, the velocity by differences of the pose."""
    robot = Arm("comau_racer_1_4").chain
    q, v = np.deg2rad([10.0, 100, -35, 5, 70, -6]), np.array([0.2, -0.1, 0.3, 0.0, 0.4, 0.1])
    pose = pose_function(robot)
    step = 1e-6
    y = pose(q).full().ravel()[:3]
    rate = (pose(q + step * v) - pose(q - step * v)).full().ravel()[:3] / (2 * step)
    row = Stepper(CommandedPoint(robot, 0.02)).step(
        joint_state=np.concatenate([q, v, q, v]), wrench=[1.0, 2.0, 3.0, 0, 0, 0]
    )
    np.testing.assert_allclose(row["position"], y + 0.02 * rate, atol=1e-8)
    np.testing.assert_array_equal(row["felt"], [1.0, 2.0, 3.0])


def test_orientation_of_a_tool_on_a_path_includes_the_lag():
    """``exp(lag [w]) R``, w by differences of the pose."""
    robot = Arm("comau_racer_1_4").chain
    q, v = np.deg2rad([10.0, 100, -35, 5, 70, -6]), np.array([0.2, -0.1, 0.3, 0.5, 0.4, 0.1])
    pose, step = pose_function(robot), 1e-5

    def rotation(at):
        return Rotation.from_matrix(pose(at).full().ravel()[3:12].reshape(3, 3))

    w = (rotation(q + step * v) * rotation(q - step * v).inv()).as_rotvec() / (2 * step)
    row = Stepper(CommandedOrientation(robot, 0.2)).step(joint_state=np.concatenate([q, v, q, v]))
    expected = (Rotation.from_rotvec(0.2 * w) * rotation(q)).as_matrix()
    np.testing.assert_allclose(row["orientation"], expected.ravel(), atol=1e-7)


def test_with_six_axes_moments_are_felt():
    robot, still = Arm("comau_racer_1_4").chain, np.zeros(24)
    wrench = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    row = Stepper(CommandedPoint(robot, 0.02, 6)).step(joint_state=still, wrench=wrench)
    np.testing.assert_array_equal(row["felt"], wrench)
    row = Stepper(FixtureReaction(2, 6), ("wrench",)).step(
        record=record([0.1, 0.2, 0.3], [(0, (0.0, 0.0, 1.0), 7.0)]), wrench=wrench
    )
    np.testing.assert_allclose(row["felt"], [1.0, 2.0, 10.0, 4.0, 5.0, 6.0], atol=1e-12)
