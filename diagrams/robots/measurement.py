"""What the controller measures, and what disturbs the robot."""

from typing import Protocol

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, ZeroOrderHold

from diagrams.scenario import PathFollowingScenario
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.physics.force_profile import ForceProfile
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.physics.decoupled_force import DecoupledForce
from pfsc_drake.systems.physics.joint_encoders import EncoderOptions, JointEncoders
from pfsc_drake.systems.physics.scripted_force import ScriptedForce
from pfsc_drake.systems.physics.sensor_failure import SensorFailure


def add_joint_state(
    builder: DiagramBuilder,
    joint_state: OutputPort,
    robot: RobotModel,
    scenario: PathFollowingScenario,
) -> OutputPort:
    """Add what encoders make of the joint state, and return ``[q_J, v_J, q_M, v_M]`` as measured.

    Args:
        builder: Builder of the diagram.
        joint_state: The true one.
        robot: The robot.
        scenario: The scenario.

    Raises:
        InputError: If the encoders do not suit the robot, or a sensor is to fail that does
            not exist.
    """
    measured = _add_imperfection(builder, joint_state, robot, scenario)
    failure = scenario.simulation.sensor_failure
    if failure.time < 0.0:
        return measured
    size = 4 * robot.dimension
    if not 0 <= failure.component < size:
        raise InputError(
            f"simulation.sensor_failure.component: {failure.component}; allowed: 0 to {size - 1}"
        )
    broken = builder.AddNamedSystem(
        "sensor_failure", SensorFailure(size, failure.component, failure.time)
    )
    builder.Connect(measured, broken.GetInputPort("measured"))
    return broken.GetOutputPort("delivered")


def states_to_log(
    scenario: PathFollowingScenario, joint_state: OutputPort, measured: OutputPort
) -> dict[str, OutputPort]:
    """Return ``joint_state`` for the log, and ``joint_state_measured`` with imperfect encoders.

    Without, what is measured is the truth, until a sensor fails.

    Args:
        scenario: The scenario.
        joint_state: The true one.
        measured: What the law gets, see :func:`add_joint_state`.
    """
    if scenario.encoders == EncoderOptions():
        return {"joint_state": measured}
    return {"joint_state": joint_state, "joint_state_measured": measured}


def _add_imperfection(
    builder: DiagramBuilder,
    joint_state: OutputPort,
    robot: RobotModel,
    scenario: PathFollowingScenario,
) -> OutputPort:
    """Add increments and difference quotients, if there are any."""
    options = scenario.encoders
    if options == EncoderOptions():
        return joint_state
    period = scenario.controller.sampling_time
    if scenario.controller.law == "velocity_servo":
        period = scenario.servo.period or period
    real = builder.AddNamedSystem("encoder_increments", JointEncoders(robot, options, period))
    builder.Connect(joint_state, real.GetInputPort("joint_state"))
    return real.GetOutputPort("joint_state")


class Pushable(Protocol):
    """A robot in a diagram that forces may act on."""

    @property
    def chain(self) -> RobotModel:
        """The robot as the laws know it."""

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Let a wrench act at the tool point, world axes, shape (6,)."""


def add_forces(
    builder: DiagramBuilder,
    body: Pushable,
    scenario: PathFollowingScenario,
    layout: PathPointLayout,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add the scenario's forces on the tool, and return their signals for the log.

    Args:
        builder: Builder of the diagram.
        body: The robot.
        scenario: The scenario.
        layout: Layout of the path point.
        ports: ``joint_state``, the true one, ``path_point``, and ``hand_wrench`` if there is
            a hand.

    Raises:
        InputError: If a force does not suit the robot.
    """
    period, sources = scenario.controller.sampling_time, []
    if scenario.forces:
        profile = ForceProfile(scenario.forces)
        operator = builder.AddNamedSystem("operator", ScriptedForce(profile, layout, period))
        if profile.needs_path:
            builder.Connect(ports["path_point"], operator.GetInputPort("path_point"))
        sources.append(operator.GetOutputPort("wrench"))
    pulse = scenario.hold_back
    if pulse.force != 0.0:
        if not layout.oriented:
            raise InputError("hold_back.force: needs a path with orientation and six axes")
        shape = (pulse.begin, pulse.end, pulse.ramp, pulse.force)
        brake = builder.AddNamedSystem(
            "hold_back", DecoupledForce(body.chain, layout, shape, period)
        )
        for name in ("joint_state", "path_point"):
            builder.Connect(ports[name], brake.GetInputPort(name))
        sources.append(brake.GetOutputPort("wrench"))
    if "hand_wrench" in ports:
        sources.append(ports["hand_wrench"])
    if not sources:
        return {}
    total = sum_of_wrenches(builder, "wrench", sources)
    # held over a tick, so that it is computed once and not in every stage of the integrator
    hold = builder.AddNamedSystem("wrench_hold", ZeroOrderHold(period, 6))
    builder.Connect(total, hold.get_input_port())
    wrench = hold.get_output_port()
    body.connect_wrench(builder, wrench, ports["joint_state"])
    return {"wrench_ext": wrench}


def sum_of_wrenches(builder: DiagramBuilder, name: str, sources: list[OutputPort]) -> OutputPort:
    """Return the sum of one wrench or more, by a system of a name if there are several.

    Args:
        builder: Builder of the diagram.
        name: Of the system.
        sources: The wrenches, each (6,).
    """
    if len(sources) == 1:
        return sources[0]
    total = builder.AddNamedSystem(name, Adder(len(sources), 6))
    for i, source in enumerate(sources):
        builder.Connect(source, total.get_input_port(i))
    return total.get_output_port()
