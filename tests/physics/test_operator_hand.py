"""Hands that guide the tool: of a simulated operator, and of a person at a screen."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, MatrixGain

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandParameters, HandWaypoint
from pfsc_drake.physics.operator_hand import LiveHand, LiveHandParameters, OperatorHand, ToolMotion
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.plants.applied_wrenches import ExternalWrench

PERIOD = 1e-3
UPRIGHT = np.eye(3).ravel()


class FreeMass(LeafSystem):
    """A point mass with viscous friction, as a tool."""

    def __init__(self, mass, friction):
        super().__init__()
        self._mass, self._friction = mass, friction
        self.DeclareContinuousState(3, 3, 0)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self.DeclareVectorOutputPort(
            "tool_pose",
            12,
            lambda context, output: output.SetFromVector(
                np.append(context.get_continuous_state_vector().CopyToVector()[:3], UPRIGHT)
            ),
            prerequisites_of_calc={self.xc_ticket()},
        )

    def DoCalcTimeDerivatives(self, context, derivatives):
        v = context.get_continuous_state_vector().CopyToVector()[3:]
        force = self._wrench.Eval(context)[:3] - self._friction * v
        derivatives.get_mutable_vector().SetFromVector(np.append(v, force / self._mass))


class Pose(LeafSystem):
    """A tool pose over time."""

    def __init__(self, position):
        super().__init__()
        self.DeclareVectorOutputPort(
            "tool_pose",
            12,
            lambda context, output: output.SetFromVector(
                np.append(position(context.get_time()), UPRIGHT)
            ),
            prerequisites_of_calc={self.time_ticket()},
        )


def hand(waypoint=(0.0, 0.0, 0.0), **changes):
    values = {"waypoints": [HandWaypoint(0.0, waypoint)], "grip_ramp": 1e-6, **changes}
    return HandParameters(**values)


def watch(position, parameters, duration):
    """Return the wrenches for a prescribed motion; sample k is from before the tick at k T."""
    builder = DiagramBuilder()
    tool = builder.AddSystem(Pose(position))
    system = builder.AddSystem(BlockSystem(OperatorHand(parameters, PERIOD), PERIOD))
    builder.Connect(tool.get_output_port(), system.get_input_port())
    log = LogVectorOutput(system.get_output_port(), builder, PERIOD)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)
    return log.FindLog(simulator.get_context()).data().T


def guide_mass(parameters, duration, mass=4.0, friction=20.0, start=(0.0, 0.0, 0.0)):
    """Return positions, velocities and wrenches of a mass in the hand."""
    builder = DiagramBuilder()
    tool = builder.AddSystem(FreeMass(mass, friction))
    system = builder.AddSystem(BlockSystem(OperatorHand(parameters, PERIOD), PERIOD))
    builder.Connect(tool.get_output_port(), system.get_input_port())
    builder.Connect(system.get_output_port(), tool.get_input_port())
    log = LogVectorOutput(system.get_output_port(), builder, PERIOD)
    pose = LogVectorOutput(tool.get_output_port(), builder, PERIOD)
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    tool.GetMyMutableContextFromRoot(root).SetContinuousState(np.append(start, np.zeros(3)))
    simulator.AdvanceTo(duration)
    y = pose.FindLog(root).data().T[:, :3]
    return y, log.FindLog(root).data().T


def moving(t):
    return np.array([0.01 * np.sin(30.0 * t), 0.02 * t, 0.0])


@pytest.mark.parametrize("samples", [0, 1, 25])
def test_the_delay_is_a_number_of_samples(samples):
    prompt = watch(moving, hand(), 0.2)
    late = watch(moving, hand(reaction_delay=samples * PERIOD), 0.2)
    assert np.array_equal(late[samples + 2 :], prompt[2 : len(prompt) - samples])
    assert not np.any(late[: samples + 1])
    assert np.any(prompt[3])


def test_a_delay_between_samples_is_refused():
    message = (
        r"^reaction_delay = 0.0105 s: must be a multiple of the sampling time 0.001 s, up to 10 s$"
    )
    with pytest.raises(InputError, match=message):
        OperatorHand(hand(reaction_delay=0.0105), PERIOD)


def test_spring_and_damper_of_an_observed_motion():
    wrench = watch(lambda t: np.array([0.1 * t, 0.0, -0.02]), hand(damping=25.0), 0.1)
    k = np.arange(5, 100)
    # the log at k T shows what the tick before decided
    observed = (k - 1) * PERIOD
    assert np.allclose(wrench[k, 0], -300.0 * 0.1 * observed - 25.0 * 0.1, rtol=0, atol=1e-9)
    assert np.allclose(wrench[k, 2], 300.0 * 0.02, rtol=0, atol=1e-9)


def test_a_far_target_is_pulled_at_with_the_limit():
    wrench = watch(lambda t: np.zeros(3), hand((3.0, 4.0, 0.0), force_limit=40.0), 0.1)
    assert np.allclose(wrench[5:, :3], [24.0, 32.0, 0.0], rtol=0, atol=1e-9)


def test_a_mass_is_brought_to_the_target():
    waypoints = [HandWaypoint(0.0, [0, 0, 0]), HandWaypoint(2.0, [0.3, -0.1, 0.2])]
    y, wrench = guide_mass(HandParameters(waypoints=waypoints, reaction_delay=0.02), 5.0)
    assert np.allclose(y[-1], [0.3, -0.1, 0.2], rtol=0, atol=1e-3)
    assert np.max(np.linalg.norm(wrench[:, :3], axis=1)) < 45.0
    assert np.linalg.norm(wrench[-1, :3]) < 0.1


@pytest.mark.slow
def test_a_hand_at_rest_gives_no_more_energy_than_its_spring_holds():
    stiffness, start = 400.0, np.array([0.1, -0.05, 0.02])
    stored = 0.5 * stiffness * start @ start
    y, wrench = guide_mass(hand(stiffness=stiffness), 3.0, friction=0.0, start=start)
    # the wrench of sample k acted on the way to sample k
    work = np.cumsum(np.sum(wrench[1:, :3] * np.diff(y, axis=0), axis=1))
    assert np.max(work) <= stored
    assert abs(work[-1]) < 0.01 * stored
    assert np.linalg.norm(y[-1]) < 1e-3


def test_wrenches_are_the_seeds():
    def run(seed):
        return watch(moving, hand(tremor=1.0, seed=seed), 0.1)

    assert np.array_equal(run(1), run(1))
    assert np.max(np.abs(run(1) - run(2))) > 0.1


def test_it_lets_go_while_it_does_not_see_the_tool():
    def position(t):
        return np.array([0.01 if not 0.0195 < t < 0.0225 else np.nan, 0.0, 0.0])

    wrench = watch(position, hand(), 0.05)
    assert np.all(np.isfinite(wrench))
    assert not np.any(wrench[21:24])
    assert wrench[30] == pytest.approx([-3.0, 0, 0, 0, 0, 0])


def test_it_does_not_feed_through():
    system = BlockSystem(OperatorHand(hand(), PERIOD), PERIOD)
    assert not system.HasAnyDirectFeedthrough()


@pytest.mark.slow
def test_a_compliant_robot_moves_to_the_target():
    """The hand moves a damped, weightless robot to where it wants the tool point to be."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    tool = plant.GetFrameByName("tool_point")
    chain, coordinates = chain_from_plant(plant, tool)
    n = chain.dimension
    encoders = builder.AddSystem(
        MatrixGain(np.vstack([coordinates.link_rows, coordinates.motor_rows]))
    )
    damping = builder.AddSystem(MatrixGain(-30.0 * np.eye(4 * n)[n : 2 * n]))
    kinematics = builder.AddSystem(BlockSystem(ToolKinematics(chain), PERIOD))
    context = plant.CreateDefaultContext()
    q = np.array([0.2, 1.6, -0.5])
    plant.SetPositions(context, q)
    y_0 = tool.CalcPoseInWorld(context).translation()
    target = y_0 + np.array([0.05, 0.1, -0.05])
    waypoints = [HandWaypoint(0.0, y_0), HandWaypoint(1.0, target)]
    parameters = HandParameters(waypoints=waypoints, stiffness=600.0, damping=60.0)
    operator = builder.AddSystem(BlockSystem(OperatorHand(parameters, PERIOD), PERIOD))
    external = builder.AddSystem(ExternalWrench(tool, chain))
    connect = builder.Connect
    connect(plant.get_state_output_port(), encoders.get_input_port())
    for system in (damping, kinematics):
        connect(encoders.get_output_port(), system.get_input_port())
    connect(encoders.get_output_port(), external.GetInputPort("joint_state"))
    connect(damping.get_output_port(), plant.get_actuation_input_port())
    connect(kinematics.get_output_port(), operator.get_input_port())
    connect(operator.get_output_port(), external.GetInputPort("wrench"))
    connect(
        external.GetOutputPort("applied_spatial_force"),
        plant.GetInputPort("applied_spatial_force"),
    )
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), q)
    simulator.AdvanceTo(4.0)
    y = kinematics.get_output_port().Eval(kinematics.GetMyContextFromRoot(root))[:3]
    assert np.linalg.norm(y - target) < 5e-3


def test_it_turns_the_tool_as_it_sees_it():
    """The tool is upright; the torque is proportional to the whole rotation, about its axis."""
    waypoints = [HandWaypoint(0.0, np.zeros(3), [0.0, 0.0, 30.0])]
    changes = {"rotational_stiffness": 4.0, "torque_limit": 1.5}
    wrench = watch(lambda t: np.zeros(3), hand(**changes | {"waypoints": waypoints}), 0.01)
    assert wrench[-1] == pytest.approx([0, 0, 0, 1.5, 0, 0])
    waypoints = [HandWaypoint(0.0, np.zeros(3), [15.0, 0.0, 0.0])]
    wrench = watch(lambda t: np.zeros(3), hand(**changes | {"waypoints": waypoints}), 0.01)
    assert wrench[-1] == pytest.approx([0, 0, 0, 0, 0, 4.0 * np.deg2rad(15.0)])


HAND = LiveHandParameters(stiffness=400.0, damping=30.0, rotational_damping=0.3)
AT_HOME = np.concatenate([[0.8, 0.1, 0.9], np.eye(3).ravel()])


def ask(push=(0.0, 0.0, 0.0), hold=0.0, target=(0.0, 0.0, 0.0)):
    return np.concatenate([push, [hold], target])


def person():
    return Stepper(LiveHand(HAND, PERIOD))


def follow(stepper, request, poses):
    """Return the wrenches that answer poses."""
    wrenches = []
    for pose in poses:
        stepper.step(request=request, tool_pose=pose)
        wrenches.append(stepper.states["wrench"])
    return np.array(wrenches)


def test_a_push_comes_as_two_lags_let_it():
    wrenches = follow(person(), ask(push=(0.0, 20.0, 0.0)), [AT_HOME] * 400)
    t = PERIOD * np.arange(1, 401) / HAND.response_time
    expected = 20.0 * (1.0 - (1.0 + t) * np.exp(-t))
    assert np.abs(wrenches[:, 1] - expected).max() < 0.02 * 20.0
    assert np.abs(np.diff(wrenches[:, 1])).max() < 20.0 / np.e * PERIOD / HAND.response_time * 1.05
    assert not wrenches[:, [0, 2, 3, 4, 5]].any()


def test_a_holding_hand_is_a_spring_and_a_damper():
    stepper, target = person(), AT_HOME[:3] + np.array([0.03, 0.0, -0.02])
    request = ask(hold=1.0, target=target)
    wrenches = follow(stepper, request, [AT_HOME] * 1500)
    assert wrenches[-1][:3] == pytest.approx(400.0 * np.array([0.03, 0.0, -0.02]), abs=1e-6)
    velocity, spin = np.array([0.1, -0.2, 0.05]), 0.4
    c, s = np.cos(spin * PERIOD), np.sin(spin * PERIOD)
    before = AT_HOME.copy()
    before[:3] -= PERIOD * velocity
    before[3:] = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).ravel()
    moving = follow(stepper, request, [before, AT_HOME])
    assert moving[1][:3] - wrenches[-1][:3] == pytest.approx(-30.0 * velocity, abs=1e-6)
    assert moving[1][3:] == pytest.approx([0.0, 0.0, -0.3 * spin], abs=1e-6)


def test_it_is_no_stronger_than_its_limit():
    far = AT_HOME[:3] + np.array([3.0, 4.0, 0.0])
    wrenches = follow(person(), ask(push=(0.0, 0.0, 40.0), hold=1.0, target=far), [AT_HOME] * 1000)
    sizes = np.linalg.norm(wrenches[:, :3], axis=1)
    assert sizes.max() == pytest.approx(45.0, rel=1e-9)
    assert wrenches[-1][:3] == pytest.approx(45.0 * np.array([1200, 1600, 40]) / 2000.4, rel=1e-3)


def test_an_open_hand_closes_at_the_requested_target():
    """Not on the way from where it held before; and nothing pulls while it closes."""
    stepper = person()
    follow(stepper, ask(hold=1.0, target=(5.0, 5.0, 5.0)), [AT_HOME] * 500)
    follow(stepper, ask(), [AT_HOME] * 1000)
    wrenches = follow(stepper, ask(hold=1.0, target=AT_HOME[:3]), [AT_HOME] * 500)
    assert np.abs(wrenches).max() < 1e-3


def test_a_hand_that_opens_draws_nothing_elsewhere():
    """A target without a request to hold is ignored."""
    stepper = person()
    follow(stepper, ask(hold=1.0, target=AT_HOME[:3]), [AT_HOME] * 500)
    assert np.abs(follow(stepper, ask(), [AT_HOME] * 500)).max() < 1e-9


def test_it_holds_its_wrench_until_the_next_look():
    stepper = person()
    before = [np.zeros(6), *follow(stepper, ask(push=(5.0, 0.0, 0.0)), [AT_HOME] * 20)]
    shown = stepper.step(request=ask(), tool_pose=AT_HOME)["wrench"]
    assert np.array_equal(shown, before[-1])


def test_it_does_nothing_to_a_tool_that_is_nowhere_and_goes_on_after():
    poses = [AT_HOME] * 50 + [AT_HOME * np.nan] + [AT_HOME] * 2
    request = ask(push=(5.0, 0.0, 0.0), hold=1.0, target=(0.9, 0.1, 0.8))
    forces = np.linalg.norm(follow(person(), request, poses), axis=1)
    assert forces[49] > 1.0
    assert forces[50] == 0.0
    assert forces[52] > forces[49]


@pytest.mark.parametrize(
    ("key", "value"), [("force_limit", 0.0), ("damping", -1.0), ("response_time", np.nan)]
)
def test_what_no_hand_has_is_refused(key, value):
    with pytest.raises(InputError, match=f"{key} = {value}"):
        LiveHandParameters(**{key: value})


def test_motion_is_drakes():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
    plant.Finalize()
    tool, context = plant.GetFrameByName("tool_point"), plant.CreateDefaultContext()
    chain, _ = chain_from_plant(plant, tool)
    stepper, random = Stepper(ToolMotion(chain)), np.random.default_rng(1)
    for _ in range(10):
        state = random.uniform(-1.5, 1.5, 12)
        plant.SetPositions(context, state[:3])
        plant.SetVelocities(context, state[3:6])
        X_WT, V_WT = tool.CalcPoseInWorld(context), tool.CalcSpatialVelocityInWorld(context)
        pose = np.concatenate([X_WT.translation(), X_WT.rotation().matrix().ravel()])
        motion = stepper.step(joint_state=state)["tool_motion"]
        np.testing.assert_allclose(motion[:12], pose, atol=1e-12)
        expected = [*V_WT.translational(), *V_WT.rotational()]
        np.testing.assert_allclose(motion[12:], expected, atol=1e-12)
