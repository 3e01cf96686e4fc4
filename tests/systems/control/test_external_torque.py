"""External torques of a wrench on the tool, and the law that is told of them."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import add_models_to, resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.control.external_torque import ExternalTorque

PERIOD = 1e-3
WRENCH = np.array([12.0, -7.0, 30.0, 1.5, -0.8, 0.6])
Q = np.array([0.3, 1.2, -0.5, 0.4, 0.9, -0.2])


@pytest.fixture(name="robot", scope="module")
def fixture_robot():
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    add_models_to(parser.package_map())
    parser.AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    frame = plant.GetFrameByName("tool_point")
    chain, coordinates = chain_from_plant(plant, frame)
    context = plant.CreateDefaultContext()
    state = coordinates.plant_state(np.concatenate([Q, np.zeros(6), Q, np.zeros(6)]))
    plant.SetPositionsAndVelocities(context, state)
    world = plant.world_frame()
    J = plant.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kV, frame, np.zeros(3), world, world
    )
    # rows of J: angular, linear; columns: the plant's velocities
    links = coordinates.link_rows[6:, plant.num_positions() :]
    tau = links @ (J[3:].T @ WRENCH[:3] + J[:3].T @ WRENCH[3:])
    return chain, tau


def bench(robot, **options):
    system = ExternalTorque(robot, options.pop("num_derivatives", 2), PERIOD, **options)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("joint_state").FixValue(
        context, np.concatenate([Q, np.zeros(6), Q, np.zeros(6)])
    )

    def push(scale):
        system.GetInputPort("wrench").FixValue(context, scale * WRENCH)

    def rows():
        return system.GetOutputPort("tau_ext").Eval(context).reshape(-1, 6).copy()

    push(1.0)
    simulator.Initialize()
    return simulator, push, rows


def test_is_drakes_jacobian_transposed(robot):
    chain, tau = robot
    _, _, rows = bench(chain)
    assert np.allclose(rows()[0], tau, rtol=0, atol=1e-10)
    assert np.array_equal(rows()[1:], np.zeros((2, 6)))


def test_derivatives_of_a_parabola_are_found(robot):
    chain, tau = robot
    simulator, push, rows = bench(chain, bandwidth=200.0)
    for k in range(300):
        push(1.0 + 2.0 * (k * PERIOD) + 40.0 * (k * PERIOD) ** 2)
        if k < 299:
            simulator.AdvanceTo((k + 1) * PERIOD)
    t = 299 * PERIOD
    expected = np.outer([1.0 + 2.0 * t + 40.0 * t**2, 2.0 + 80.0 * t, 80.0], tau)
    assert np.allclose(rows(), expected, rtol=1e-5, atol=1e-8)


def test_a_constant_wrench_is_there_from_the_first_tick(robot):
    chain, tau = robot
    simulator, _, rows = bench(chain, bandwidth=50.0)
    for end in (0.0, 5 * PERIOD):
        simulator.AdvanceTo(end)
        assert np.allclose(rows()[0], tau, rtol=0, atol=1e-10)
        assert np.allclose(rows()[1:], 0.0, rtol=0, atol=1e-6)


def test_nan_comes_out_and_is_not_remembered(robot):
    chain, tau = robot
    simulator, push, rows = bench(chain, bandwidth=50.0)
    simulator.AdvanceTo(5 * PERIOD)
    push(np.nan)
    assert np.isnan(rows()).all()
    simulator.AdvanceTo(8 * PERIOD)
    push(1.0)
    assert np.allclose(rows()[0], tau, rtol=0, atol=1e-10)


def test_wrong_numbers_are_refused(robot):
    with pytest.raises(InputError, match="number of derivatives: 3"):
        ExternalTorque(robot[0], 3, PERIOD, 10.0)
    with pytest.raises(InputError, match="bandwidth = -1"):
        ExternalTorque(robot[0], 2, PERIOD, -1.0)
