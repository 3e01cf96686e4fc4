"""An impedance's deflection and its moving target; joint servos against Drake's own inertia."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.studies.peers.lap import FOLDER, start_posture
from experiments.studies.peers.laws import (
    CartesianImpedance,
    ImpedanceGains,
    JointServos,
    MovingPose,
    moving_pose,
)
from experiments.studies.peers.world import under_law
from pfsc_drake.robot.robot_model import pose_function

FORCE = np.array([5.0, -8.0, 12.0])  # N


@pytest.fixture(scope="module")
def q_0(station):
    return start_posture(station)


@pytest.fixture(scope="module")
def weight(station):
    """Torques that hold the arm, by Drake."""

    def hold(q):
        context = station.part.model.CreateDefaultContext()
        station.part.model.SetPositions(context, q)
        return -station.part.model.CalcGravityGeneralizedForces(context)

    return hold


def impedance(station, q_0, target, **gains):
    chosen = {"translation": 500.0, "rotation": 30.0, "posture": 1.0} | gains
    return CartesianImpedance(station.part.belief.robot, ImpedanceGains(**chosen), target, q_0)


@pytest.mark.slow
@pytest.mark.parametrize("matched", [False, True])
def test_a_constant_force_moves_the_tool_by_force_over_stiffness(lap, station, q_0, matched):
    """After it has settled in simulation, before the reference moves."""
    force = f"forces=[{{begin: 0, end: 99, ramp: 0.1, force: {FORCE.tolist()}}}]"
    still = moving_pose(lap.task.path, lap.task.motion, 1, 1e-3)
    target = MovingPose(*(np.repeat(x, 2500, axis=0) for x in vars(still).values()))
    K, gains = 2000.0, {"rotation": 100.0, "posture": 10.0, "matched": matched}
    motion = under_law(
        lap.settings((force,)),
        FOLDER,
        2.5,
        lambda station: impedance(station, q_0, target, translation=K, **gains),
    )
    pose = pose_function(station.part.robot)(motion.q[-1]).full()[:, 0]
    np.testing.assert_allclose(pose[:3] - still.position[0], FORCE / K, atol=2e-5)
    turned = Rotation.from_matrix(pose[3:].reshape(3, 3) @ still.orientation[0].T)
    assert turned.magnitude() < 1e-4


def test_an_impedance_on_its_target_holds_the_weight(lap, station, q_0, weight):
    law = impedance(station, q_0, lap.target)
    np.testing.assert_allclose(law(0, q_0, np.zeros(7)), weight(q_0), atol=1e-6)


def test_the_error_of_an_impedance_is_clipped(lap, station, q_0):
    def pull(away):
        position, orientation, twist = vars(lap.target).values()
        target = MovingPose(position + np.array([0.0, 0.0, away]), orientation, twist)
        return impedance(station, q_0, target)(0, q_0, np.zeros(7))

    np.testing.assert_allclose(pull(3.0), pull(0.1), atol=1e-6)
    assert np.abs(pull(0.1) - pull(0.05)).max() > 1.0


def test_the_twist_of_a_moving_pose_leads_from_pose_to_pose(lap):
    """By integrating it from the first tick to the last."""
    pose = moving_pose(lap.task.path, lap.task.motion, 1500, 1e-3)
    steps = (pose.twist[1:] + pose.twist[:-1]) / 2.0 * 1e-3
    moved = steps[:, :3].sum(axis=0)
    np.testing.assert_allclose(moved, pose.position[-1] - pose.position[0], atol=1e-6)
    R = Rotation.from_matrix(pose.orientation[0])
    for turn in steps[:, 3:]:
        R = Rotation.from_rotvec(turn) * R
    np.testing.assert_allclose(R.as_matrix(), pose.orientation[-1], atol=1e-6)
    assert np.linalg.norm(pose.twist[:, :3], axis=1).max() == pytest.approx(0.4, rel=1e-4)


def test_servos_pull_every_joint_back_with_their_poles(station, q_0, weight):
    """``D_i (e'' + 2 w e' + w^2 e) = 0`` with the inertia that Drake tells, rotors included."""
    model, bandwidth = station.part.model, 40.0
    context = model.CreateDefaultContext()
    model.SetPositions(context, q_0)
    inertia = np.diag(model.CalcMassMatrix(context))
    plan = np.stack([q_0, np.zeros(7)])[None]
    law = JointServos(station.part.robot, bandwidth, plan, q_0, 1e-3)
    off, v = np.linspace(-2e-3, 2e-3, 7), np.linspace(0.1, -0.1, 7)
    pulled = law(0, q_0 + off, v) - weight(q_0 + off)
    np.testing.assert_allclose(
        pulled, -inertia * (bandwidth**2 * off + 2.0 * bandwidth * v), rtol=1e-6, atol=1e-9
    )


def test_an_integral_part_takes_a_load_away(station, q_0, weight):
    """A double integrator per joint under a constant load, by its three poles."""
    model, period, load = station.part.model, 1e-3, 3.0
    context = model.CreateDefaultContext()
    model.SetPositions(context, q_0)
    inertia = np.diag(model.CalcMassMatrix(context))
    plan = np.tile(np.stack([q_0, np.zeros(7)]), (1500, 1, 1))
    law = JointServos(station.part.robot, 40.0, plan, q_0, period, integral=10.0)
    e, v, far = np.zeros(7), np.zeros(7), 0.0
    for tick in range(1500):
        torque = law(tick, q_0 + e, v) - weight(q_0 + e)
        v = v + period * (torque + load) / inertia
        e = e + period * v
        far = np.maximum(far, np.abs(e))
    # of (s + 40)^2 (s + 10) under a step, found from its step response
    t = np.linspace(0.0, 1.0, 100_001)
    step = np.exp(-10.0 * t) / 900.0 - np.exp(-40.0 * t) * (1.0 / 900.0 + t / 30.0)
    np.testing.assert_allclose(far, step.max() * load / inertia, rtol=0.05)
    assert np.abs(e).max() < 1e-3 * far.max()
