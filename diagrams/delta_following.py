"""Path following station of the DELTA robot: friction in front of its plant, the same law."""

from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain, ZeroOrderHold

from diagrams.drives import friction_bristles
from diagrams.following import Task, add_law, add_place_on_path, reference_progress
from diagrams.measurement import add_joint_state
from diagrams.parts import make_law, make_path
from diagrams.scenario import RobotParameters
from diagrams.scenario_delta import DeltaFollowingScenario
from diagrams.signal_log import add_log
from diagrams.start import check_points, start_point
from diagrams.station import Station
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path
from pfsc_drake.robot.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.delta import DeltaRobot
from pfsc_drake.robot.delta_parameters import load_delta_parameters
from pfsc_drake.systems.delta_plant import DeltaPlant
from pfsc_drake.systems.joint_friction import JointFriction

# m, between the points of the way along the path that are checked for reach
_REACH_SPACING = 2e-3


class DeltaFollowingStation(Station[DeltaPlant, DeltaRobot]):
    """Station of a DELTA robot; the path is in the axes of the inertial frame (z_0 down).

    Drives and slides are one, ``joint_state = [q, v, q, v]``. With friction its log also
    holds ``friction_torque``.
    """

    def place_robot(self, context: Context) -> None:
        """See :meth:`Station.place_robot`."""
        q, v = np.split(self.initial_state, 2)
        self.plant.set_state(context, q, v)


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
    plant = builder.AddNamedSystem("plant", DeltaPlant(robot))
    coordinates = _coordinates(robot)
    joint_state = add_joint_state(
        builder, plant.GetOutputPort("state"), robot, coordinates, scenario
    )
    place = add_place_on_path(builder, task, joint_state)
    controller, made = add_law(builder, task, place, {})
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(period, robot.dimension))
    builder.Connect(controller.GetOutputPort(controller.drive_port), hold.get_input_port())
    signals = place.signals | made
    signals |= _add_drives(builder, plant, robot, hold.get_output_port(), scenario)
    log = add_log(builder, signals, period)
    diagram = builder.Build()
    diagram.set_name(scenario.name or "delta_following")
    return DeltaFollowingStation(
        diagram,
        plant,
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
        warnings=[],
    )


def _coordinates(robot: DeltaRobot) -> PlantCoordinates:
    """Slides and drives are one."""
    size = 2 * robot.dimension
    return PlantCoordinates(size, np.eye(size), np.eye(size), np.arange(robot.dimension))


def _add_drives(
    builder: DiagramBuilder,
    plant: DeltaPlant,
    robot: DeltaRobot,
    drive_force: OutputPort,
    scenario: DeltaFollowingScenario,
) -> dict[str, OutputPort]:
    """Connect the drive forces with the plant, less friction; return the signal for the log."""
    actuation = plant.GetInputPort("actuation")
    if not scenario.drive_friction:
        builder.Connect(drive_force, actuation)
        return {}
    n, friction = robot.dimension, robot.parameters.friction
    slides = np.full(n, robot.parameters.masses.effective_slide)
    bristles = friction_bristles(
        scenario, friction.coulomb, friction.viscous, slides, "drive_friction"
    )
    drives = builder.AddNamedSystem("joint_friction", JointFriction(bristles))
    # the true velocity, whatever the encoders say
    velocity = builder.AddNamedSystem(
        "slide_velocity", MatrixGain(np.hstack([np.zeros((n, n)), np.eye(n)]))
    )
    builder.Connect(plant.GetOutputPort("state"), velocity.get_input_port())
    builder.Connect(velocity.get_output_port(), drives.GetInputPort("velocity"))
    builder.Connect(drive_force, drives.GetInputPort("drive_torque"))
    builder.Connect(drives.GetOutputPort("net_torque"), actuation)
    return {"friction_torque": drives.GetOutputPort("friction_torque")}


def _start_state(
    scenario: DeltaFollowingScenario, path: Path, robot: DeltaRobot
) -> tuple[np.ndarray, float]:
    """Return the plant's state at rest beside the path, and the path parameter there.

    Raises:
        InputError: If the start or the way along the path is out of the robot's reach.
    """
    points = scenario.reference.points
    check_points(points, path)
    start = start_point(scenario, path)
    q = robot.joint_coordinates(start.y_t, "start")
    begin, end = min(points), max(points)
    for eta in np.linspace(begin, end, 2 + int((end - begin) / _REACH_SPACING)):
        theta = np.array([path.arc_length.parameter(eta)])
        y_t = path.position.derivatives(theta, 0)[0, 0]
        robot.joint_coordinates(y_t, f"path at eta = {eta:.4g} m")
    return np.concatenate([q, np.zeros(robot.dimension)]), start.theta
