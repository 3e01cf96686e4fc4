"""A rigid robot as a plant in a simulation, against Drake's."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.plants.rigid_plant import RigidPlant


def fall(system, set_state, torques):
    """Return the continuous state after a while under constant torques."""
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    set_state(context)
    for port, torque in torques.items():
        system.GetInputPort(port).FixValue(context, torque)
    ResetIntegratorFromFlags(simulator, "runge_kutta5", 1e-3).set_fixed_step_mode(True)
    simulator.AdvanceTo(0.2)
    return context.get_continuous_state_vector().CopyToVector()


@pytest.mark.parametrize("robot", ["comau_racer_1_4", "franka_emika_panda"])
def test_falls_like_drakes_plant(robot):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(robot)))
    plant.Finalize()
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    n = chain.dimension
    rng = np.random.default_rng(0)
    q, v, tau = rng.uniform(-0.5, 0.5, (3, n)) * [[1.0], [1.0], [10.0]]
    ours = RigidPlant(chain)
    drakes = fall(
        plant, lambda c: plant.SetPositionsAndVelocities(c, np.append(q, v)), {"actuation": tau}
    )
    got = fall(ours, lambda c: ours.set_state(c, q, v), {"actuation": tau})
    np.testing.assert_allclose(got, drakes, atol=1e-8)
    # resistance adds to the drives' torques
    shared = {"actuation": 3.0 * tau, "resistance": -2.0 * tau}
    both = fall(ours, lambda c: ours.set_state(c, q, v), shared)
    np.testing.assert_allclose(both, got, atol=1e-12)


def test_state_and_ports():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    ours = RigidPlant(chain)
    context = ours.CreateDefaultContext()
    ours.set_state(context, np.arange(6.0))
    expected = np.append(np.arange(6.0), np.zeros(6))
    np.testing.assert_array_equal(ours.GetOutputPort("state").Eval(context), expected)
