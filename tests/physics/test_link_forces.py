"""Joint torques and points of action of wrenches on links, against Drake's kinematics."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from pfsc_drake.physics.link_forces import LinkForces
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.link_points import point_on_link
from pfsc_drake.systems.block_system import BlockSystem

# links and points in the axes of their bodies [m]
POINTS = [
    ("link_3", np.array([0.1, -0.2, 0.05])),
    ("link_1", np.array([0.0, 0.3, 0.0])),
    ("link_5", np.zeros(3)),
]


@pytest.fixture(scope="module")
def plant():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    return plant


@pytest.fixture(scope="module")
def chain(plant):
    return chain_from_plant(plant, plant.GetFrameByName("tool_point"))


@pytest.fixture
def put_out(plant, chain):
    """Return a function that evaluates the block's outputs."""
    robot, coordinates = chain
    found = [point_on_link(plant, coordinates, name, point) for name, point in POINTS]
    block = LinkForces(robot, [(one.link, one.p_LQ) for one in found])
    system = BlockSystem(block, 1e-3)

    def evaluate(joint_state, wrenches):
        context = system.CreateDefaultContext()
        system.GetInputPort("joint_state").FixValue(context, joint_state)
        system.GetInputPort("wrenches").FixValue(context, wrenches)
        return [system.GetOutputPort(name).Eval(context) for name in ("points", "tau_ext")]

    return evaluate


def test_points_and_torques_match_drake(plant, chain, put_out):
    rng = np.random.default_rng(4)
    q, v = rng.uniform(-1.5, 1.5, (2, 6))
    wrenches = rng.uniform(-30.0, 30.0, 18)
    joint_state = np.concatenate([q, v, q, v])
    coordinates = chain[1]
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, coordinates.plant_state(joint_state))
    world, expected, positions = plant.world_frame(), np.zeros(6), []
    for (link, point), wrench in zip(POINTS, wrenches.reshape(-1, 6), strict=True):
        frame = plant.GetFrameByName(link)
        jacobian = plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, frame, point, world, world
        )
        expected += jacobian.T @ np.concatenate([wrench[3:], wrench[:3]])
        positions.append(frame.CalcPoseInWorld(context) @ point)
    rows = coordinates.link_rows[6:, plant.num_positions() :]
    points, tau_ext = put_out(joint_state, wrenches)
    assert np.allclose(points, np.concatenate(positions), rtol=0, atol=1e-12)
    assert np.allclose(tau_ext, np.linalg.solve(rows.T, expected), rtol=0, atol=1e-11 * 30.0)
    assert np.abs(tau_ext[:5]).min() > 0.1
    # no point is beyond the fifth joint
    assert tau_ext[5] == 0.0


def test_where_nothing_acts_there_is_no_torque(put_out):
    _, tau_ext = put_out(np.linspace(-1.0, 1.0, 24), np.zeros(18))
    assert np.array_equal(tau_ext, np.zeros(6))
    assert not np.signbit(tau_ext).any()
