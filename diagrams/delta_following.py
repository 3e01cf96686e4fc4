"""Path following station of the DELTA robot: friction in front of its plant, the same law."""

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import MatrixGain, ZeroOrderHold

from diagrams.robots.arm import joint_state_of
from diagrams.robots.delta_body import DeltaBody, TouchingDelta, add_free_delta, add_touching_delta
from diagrams.robots.force_sensor import add_sensor, sensor_warnings
from diagrams.robots.measurement import add_forces, add_joint_state, states_to_log, sum_of_wrenches
from diagrams.scenario import RobotParameters
from diagrams.scenario.delta import DeltaFollowingScenario
from diagrams.scenario.notch import NotchParameters
from diagrams.signal_log import add_log
from diagrams.station import FurtherLength, Station
from diagrams.surroundings.notch import UP
from diagrams.surroundings.notch_motion import place_in_notch
from diagrams.tasks.external_torque import needs_sensor
from diagrams.tasks.following import Task, add_law, add_place_on_path, reference_progress
from diagrams.tasks.law import make_law
from diagrams.tasks.path import make_path
from diagrams.tasks.path_warnings import path_warnings
from diagrams.tasks.start import check_points, start_point
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path, shape_report
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.parameters import load_delta_parameters
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.systems.physics.joint_friction import JointFriction

# m, between the points of the way along the path that are checked for reach
_REACH_SPACING = 2e-3


@dataclass
class DeltaFollowingStation(Station[LeafSystem, DeltaRobot]):
    """Station of a DELTA robot; the path is in the axes of the inertial frame (z_0 down).

    Drives and slides are one, ``joint_state = [q, v, q, v]``. With friction its log also
    holds ``friction_torque``; with a notch ``wrench_ext`` of the contact, and with a sensor
    what :func:`add_sensor` returns.

    Attributes:
        body: The robot in it.
        notch: What it touches, if anything.
    """

    body: DeltaBody
    notch: NotchParameters | None

    def place_robot(self, context: Context, state: np.ndarray) -> None:
        """See :meth:`Station.place_robot`."""
        self.body.place(context, state)

    def further_lengths(self, y_t: np.ndarray) -> dict[str, FurtherLength]:
        """Return ``notch_position`` of the ball, see :func:`place_in_notch`."""
        if self.notch is None:
            return {}
        place = place_in_notch(self.path, self.notch, y_t, self.initial_theta)
        free = self.notch.clearance
        return {"notch_position": FurtherLength(place, ["left", "above"], free)}


def load_delta_robot(parameters: RobotParameters, folder: FilePath) -> DeltaRobot:
    """Return the DELTA robot of a scenario.

    Args:
        parameters: Which robot.
        folder: Where relative file names start.

    Raises:
        InputError: If its parameters cannot be read.
    """
    model = parameters.model
    return DeltaRobot(load_delta_parameters(folder / model if FilePath(model).suffix else model))


def build_delta_following(
    scenario: DeltaFollowingScenario, folder: FilePath
) -> DeltaFollowingStation:
    """Build the station of a path following scenario of a DELTA robot.

    Args:
        scenario: The scenario.
        folder: Where the scenario's relative file names start.

    Returns:
        The station; everything in the scenario that can be wrong has been checked.

    Raises:
        InputError: If the scenario cannot be built.
    """
    if scenario.controller.law != "rigid":
        raise InputError(
            f"controller.law: {scenario.controller.law}; allowed: rigid, the drives of a DELTA "
            "robot are stiff and take forces"
        )
    robot = load_delta_robot(scenario.robot, folder)
    period = scenario.controller.sampling_time
    path = make_path(scenario.path, scenario.controller.law, folder)
    if path.orientation is not None:
        raise InputError("path: has an orientation; a DELTA robot only translates")
    law = make_law(scenario.controller, robot, oriented=False)
    initial_state, initial_theta = _start_state(scenario, path, robot)
    task = Task(scenario, robot, path, law, reference_progress(scenario))

    builder = DiagramBuilder()
    body = _add_body(builder, robot, path, scenario)
    coordinates = _coordinates(robot)
    slides = body.slide_state(builder)
    true_state = joint_state_of(builder, slides, coordinates)
    joint_state = add_joint_state(builder, true_state, robot, scenario)
    place = add_place_on_path(builder, task, joint_state)
    around = place.signals | {"joint_state": true_state}
    forces = add_forces(builder, body, scenario, law.linearization.layout, around)
    if isinstance(body, TouchingDelta):
        builder.Connect(place.signals["tool_pose"], body.contact.GetInputPort("tool_pose"))
        wrenches = [body.contact.GetOutputPort("wrench"), *forces.values()]
        forces = {"wrench_ext": sum_of_wrenches(builder, "all_wrenches", wrenches)}
        if needs_sensor(scenario):
            forces |= add_sensor(builder, body.multibody, robot, body.tool, scenario, joint_state)
    controller, made = add_law(builder, task, place, forces)
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(period, robot.dimension))
    builder.Connect(controller.GetOutputPort(controller.drive_port), hold.get_input_port())
    signals = place.signals | forces | made | states_to_log(scenario, true_state, joint_state)
    signals |= _add_drives(builder, body, hold.get_output_port(), slides, scenario)
    log = add_log(builder, signals, period)
    diagram = builder.Build()
    diagram.set_name(scenario.name or "delta_following")
    return DeltaFollowingStation(
        diagram,
        body.plant,
        robot,
        coordinates,
        path,
        law,
        place.projector,
        controller,
        log,
        task.progress.domain[1],
        initial_state,
        initial_theta,
        on_motors=False,
        warnings=path_warnings(path, shape_report(path)) + sensor_warnings(scenario),
        body=body,
        notch=scenario.notch,
    )


def _coordinates(robot: DeltaRobot) -> PlantCoordinates:
    """Slides and drives are one."""
    size = 2 * robot.dimension
    return PlantCoordinates(size, np.eye(size), np.eye(size), np.arange(robot.dimension))


def _add_body(
    builder: DiagramBuilder, robot: DeltaRobot, path: Path, scenario: DeltaFollowingScenario
) -> DeltaBody:
    if scenario.notch is None:
        return add_free_delta(builder, robot)
    return add_touching_delta(
        builder, robot, path, scenario.notch, scenario.controller.sampling_time
    )


def _add_drives(
    builder: DiagramBuilder,
    body: DeltaBody,
    drive_force: OutputPort,
    slide_state: OutputPort,
    scenario: DeltaFollowingScenario,
) -> dict[str, OutputPort]:
    """Connect the drive forces with the plant, less friction; return the signal for the log."""
    if not scenario.drive_friction:
        body.connect_drives(builder, drive_force, None)
        return {}
    n = body.chain.dimension
    friction = builder.AddNamedSystem("joint_friction", JointFriction(body.bristles(scenario)))
    # the true velocity, whatever the encoders say
    velocity = builder.AddNamedSystem(
        "slide_velocity", MatrixGain(np.hstack([np.zeros((n, n)), np.eye(n)]))
    )
    builder.Connect(slide_state, velocity.get_input_port())
    builder.Connect(velocity.get_output_port(), friction.GetInputPort("velocity"))
    body.connect_drives(builder, drive_force, friction)
    return {"friction_torque": friction.GetOutputPort("friction_torque")}


def _start_state(
    scenario: DeltaFollowingScenario, path: Path, robot: DeltaRobot
) -> tuple[np.ndarray, float]:
    """Return the plant's state at rest beside the path, and the path parameter there.

    Raises:
        InputError: If the start or the way along the path is out of the robot's reach.
    """
    points = scenario.reference.points
    check_points(points, path)
    notch, shift = scenario.notch, np.zeros(3)
    if notch is not None:  # in its middle, where the ball touches nothing
        shift = np.array(notch.displacement) + notch.clearance * UP
    start = start_point(scenario, path, shift)
    q = robot.joint_coordinates(start.y_t, "start")
    begin, end = min(points), max(points)
    for eta in np.linspace(begin, end, 2 + int((end - begin) / _REACH_SPACING)):
        theta = np.array([path.arc_length.parameter(eta)])
        on_path = path.position.derivatives(theta, 0)[0, 0]
        robot.joint_coordinates(on_path, f"path at eta = {eta:.4g} m")
    return np.concatenate([q, np.zeros(robot.dimension)]), start.theta
