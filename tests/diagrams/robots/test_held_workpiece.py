"""A workpiece in a robot's hand: its inertia by the parallel axis theorem, and the plant's."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.robots.arm_model import nominal_arm, read_arm
from diagrams.robots.nominal_model import WORKPIECE, NominalModelSource
from diagrams.scenario import (
    HolderWorkpiece,
    ModelErrorParameters,
    RobotParameters,
    SolidParameters,
)
from diagrams.scenario.robot import PoseParameters
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.robot.robot_model import gravity_function

BOX = SolidParameters(box=[0.1, 0.2, 0.3], mass=2.0)
ROD = SolidParameters(
    cylinder=[0.05, 0.4],
    mass=1.5,
    pose=PoseParameters(position=[0.1, -0.2, 0.3], zyx_deg=[20.0, 90.0, -10.0]),
)
# ``[q_J, v_J, q_M, v_M]`` of which one link moves
MOVED = np.eye(24)[6:12]


def test_the_inertia_of_a_box_and_a_rod():
    M = HolderWorkpiece(solids=[BOX, ROD]).inertia
    x, y, z = BOX.box
    box = BOX.mass / 12.0 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])
    r, length = ROD.cylinder
    across = ROD.mass * (3.0 * r**2 + length**2) / 12.0
    R = zyx_to_matrix(np.deg2rad(ROD.pose.zyx_deg))
    p = np.array(ROD.pose.position)
    rod = R @ np.diag([across, across, ROD.mass * r**2 / 2.0]) @ R.T
    rod += ROD.mass * (p @ p * np.eye(3) - np.outer(p, p))
    assert M.get_mass() == pytest.approx(3.5)
    assert np.allclose(M.get_com(), ROD.mass * p / 3.5, rtol=0, atol=1e-15)
    inertia = M.CalcRotationalInertia().CopyToFullMatrix3()
    assert np.allclose(inertia, box + rod, rtol=0, atol=1e-14)


@pytest.fixture(name="source")
def fixture_source():
    workpiece = HolderWorkpiece(
        pose=PoseParameters(position=[0.0, 0.02, 0.1], zyx_deg=[0.0, 30.0, 0.0]), solids=[BOX, ROD]
    )
    robot = RobotParameters(model="comau_racer_1_4_elastic", tool_frame="tool_point")
    error = ModelErrorParameters(tool_mass=-0.2)
    return NominalModelSource(robot, "", error, Path()).holding(workpiece)


def test_the_workpiece_is_the_tool_of_the_robot_that_holds_it(source):
    arm = read_arm(source.robot, Path(), before_finalizing=source.add_payload)
    plant, context = arm.plant, arm.plant.CreateDefaultContext()
    grip = plant.GetFrameByName("tool_point")
    X_GC = plant.CalcRelativeTransform(context, grip, arm.tool)
    assert arm.tool.name() == WORKPIECE
    assert np.allclose(X_GC.translation(), [0.0, 0.02, 0.1], rtol=0, atol=1e-15)
    R = zyx_to_matrix(np.deg2rad([0.0, 30.0, 0.0]))
    assert np.allclose(X_GC.rotation().matrix(), R, rtol=0, atol=1e-14)
    assert arm.tool_mass()[0] == pytest.approx(3.5)
    # the chain's weight is that of Drake's plant
    q = np.array([0.3, 1.4, -0.7, 0.2, 0.9, -0.4])
    state = arm.coordinates.plant_state(np.concatenate([q, 0 * q, q, 0 * q]))
    plant.SetPositionsAndVelocities(context, state)
    # a link's weight is what it takes to move it, motors at rest
    rates = [arm.coordinates.plant_state(column)[plant.num_positions() :] for column in MOVED]
    weight = -np.array(rates) @ plant.CalcGravityGeneralizedForces(context)
    assert np.allclose(gravity_function(arm.chain)(q).full().ravel(), weight, rtol=0, atol=1e-9)


def test_its_mass_has_the_error_of_the_nominal_model(source):
    arm = read_arm(source.robot, Path(), before_finalizing=source.add_payload)
    nominal_model, _ = nominal_arm(arm, source)
    assert nominal_model.robot.gather("mass")[-1] == pytest.approx(
        arm.chain.gather("mass")[-1] - 0.2
    )


def test_it_is_added_once(source):
    with pytest.raises(InputError, match=f"has a link '{WORKPIECE}'"):
        read_arm(
            source.robot,
            Path(),
            before_finalizing=lambda plant: [source.add_payload(plant) for _ in range(2)],
        )
