"""Serial robots with stiff or elastic joints, whose rotors and links are coupled by inertia."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.rotor_coupling import RotorMount, full_energy_function, mounts_from_dh
from pfsc_drake.systems.plants.coupled_plants import FullElasticPlant, RigidPlant


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


# Tab. 2.3, see test_rotor_coupling.py
AXES = [[0, 1, 0], [0, 0, -1], [0, -1, 0], [0, 0, 1], [0, 1, 0], [0, 1, 0]]
PARAMETERS = load_parameters("comau_racer_1_4")
MOUNTS = mounts_from_dh(
    [1, 1, 3, 3, 4, 5],
    AXES,
    PARAMETERS.rotors.gear_ratio,
    np.deg2rad(PARAMETERS.denavit_hartenberg.alpha_deg),
)
UNCOUPLED = [RotorMount(m.link, m.axis, np.inf) for m in MOUNTS]
POSTURE = np.deg2rad([0.0, 96.0, -32.3, 0.0, 71.4, -5.7])
N = 6


@pytest.fixture(scope="module")
def robot():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_elastic")))
    plant.Finalize()
    return plant, *chain_from_plant(plant, plant.GetFrameByName("tool_point"))


def start(seed=0):
    rng = np.random.default_rng(seed)
    return np.concatenate([POSTURE, rng.uniform(-1.0, 1.0, N), POSTURE, np.zeros(N)])


def simulate(system, set_state, tau_d, duration, step):
    """Return the context at the end of a fall from :func:`start` under constant torques."""
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    set_state(context)
    name = "drive_torque" if isinstance(system, FullElasticPlant) else "actuation"
    system.GetInputPort(name).FixValue(context, tau_d)
    ResetIntegratorFromFlags(simulator, "runge_kutta5", step).set_fixed_step_mode(True)
    simulator.AdvanceTo(duration)
    return context


def test_without_coupling_moves_like_drakes_plant(robot):
    plant, chain, coordinates = robot
    tau_d = np.array([10.0, 200.0, 60.0, 3.0, 5.0, -1.0])
    full = FullElasticPlant(chain, UNCOUPLED)
    ours = simulate(full, lambda c: full.set_joint_state(c, start()), tau_d, 0.1, 1e-4)
    drakes = simulate(
        plant,
        lambda c: plant.SetPositionsAndVelocities(c, coordinates.plant_state(start())),
        tau_d[np.argsort(coordinates.actuators)],
        0.1,
        1e-4,
    )
    x = plant.GetPositionsAndVelocities(drakes)
    expected = np.concatenate([coordinates.link_rows @ x, coordinates.motor_rows @ x])
    got = full.GetOutputPort("joint_state").Eval(ours)
    assert np.allclose(got, expected, rtol=0, atol=1e-9)


def test_energy_is_conserved(robot):
    _, chain, _ = robot
    full = FullElasticPlant(chain, MOUNTS)
    energy = full_energy_function(chain, MOUNTS)

    def total(context):
        return sum(float(e) for e in energy(context.get_continuous_state_vector().CopyToVector()))

    at_start = full.CreateDefaultContext()
    full.set_joint_state(at_start, start())
    end = simulate(full, lambda c: full.set_joint_state(c, start()), np.zeros(N), 0.5, 2e-4)
    moved = full.GetOutputPort("joint_state").Eval(end)[:N] - POSTURE
    assert np.max(np.abs(moved)) > 0.3
    assert np.isclose(total(end), total(at_start), rtol=0, atol=2e-6)


def test_rests_in_equilibrium(robot):
    """Motors hold the weight, springs carry it; an external torque takes its share."""
    _, chain, _ = robot
    full = FullElasticPlant(chain, MOUNTS)
    weight = np.array(gravity_function(chain)(POSTURE)).ravel()
    push = np.linspace(-20.0, 30.0, N)
    context = full.CreateDefaultContext()
    for external in (None, push):
        load = weight if external is None else weight - external
        rest = np.concatenate([POSTURE, np.zeros(N), POSTURE + load / chain.K_s, np.zeros(N)])
        full.set_joint_state(context, rest)
        full.GetInputPort("drive_torque").FixValue(context, load)
        if external is not None:
            full.GetInputPort("external_torque").FixValue(context, external)
        rates = full.EvalTimeDerivatives(context).CopyToVector()
        assert np.max(np.abs(rates)) < 1e-6


def test_ports_and_two_contexts(robot):
    full = FullElasticPlant(robot[1], MOUNTS)
    for name in ("joint_state", "link_acceleration"):
        needs_inputs = full.HasDirectFeedthrough(full.GetOutputPort(name).get_index())
        assert needs_inputs == (name == "link_acceleration")
    contexts = [full.CreateDefaultContext() for _ in range(2)]
    rates = []
    for seed, context in enumerate(contexts):
        full.set_joint_state(context, start(seed))
        full.GetInputPort("drive_torque").FixValue(context, np.zeros(N))
    for seed, context in enumerate(contexts):
        assert np.array_equal(full.GetOutputPort("joint_state").Eval(context), start(seed))
        rates.append(full.EvalTimeDerivatives(context).CopyToVector())
        assert np.array_equal(rates[-1][:N], start(seed)[N : 2 * N])
    assert not np.allclose(rates[0], rates[1])
