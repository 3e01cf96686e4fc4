"""Path following station: robot, projector, law, drives and log in one diagram."""

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem

from diagrams.robots.arm import Arm, add_arm
from diagrams.robots.drives import add_drives, add_friction
from diagrams.robots.force_sensor import add_sensor, sensor_warnings
from diagrams.robots.measurement import add_forces, add_joint_state, states_to_log
from diagrams.scenario import PathFollowingScenario
from diagrams.signal_log import add_log
from diagrams.station import Station
from diagrams.surroundings.hand import add_hand
from diagrams.tasks.external_torque import needs_sensor
from diagrams.tasks.following import Task, add_law, add_place_on_path, reference_progress
from diagrams.tasks.law import make_law
from diagrams.tasks.law_warnings import law_warnings
from diagrams.tasks.path import make_path
from diagrams.tasks.start import posture_warnings, start_state
from pfsc_drake.robot.serial.chain import SerialChain


@dataclass
class PathFollowingStation(Station[LeafSystem, SerialChain]):
    """Station of a serial arm.

    Its log also holds, with forces ``wrench_ext``, with compliance what
    :func:`add_compliance` returns, with servos ``drive_torque``, with friction
    ``friction_torque``.

    Attributes:
        arm: The robot in it.
    """

    arm: Arm

    def place_robot(self, context: Context, state: np.ndarray) -> None:
        """See :meth:`Station.place_robot`."""
        self.arm.place(context, state)


def build_path_following(scenario: PathFollowingScenario, folder: FilePath) -> PathFollowingStation:
    """Build the station of a path following scenario.

    Args:
        scenario: The scenario.
        folder: Where the scenario's relative file names start.

    Returns:
        The station; everything in the scenario that can be wrong has been checked.

    Raises:
        InputError: If the scenario cannot be built.
    """
    builder = DiagramBuilder()
    arm = add_arm(builder, scenario.robot, folder)
    chain, coordinates = arm.chain, arm.coordinates
    period, law_name = scenario.controller.sampling_time, scenario.controller.law
    path = make_path(scenario.path, law_name, folder)
    law = make_law(scenario.controller, chain, path.orientation is not None)
    initial_state, initial_theta = start_state(scenario, path, chain, coordinates)
    on_motors = law_name == "rigid" and chain.is_elastic
    task = Task(scenario, chain, path, law, reference_progress(scenario), on_motors)

    true_state = arm.joint_state(builder)
    joint_state = add_joint_state(builder, true_state, chain, scenario)
    place = add_place_on_path(builder, task, joint_state)
    signals = dict(place.signals)
    hand = add_hand(builder, arm, path, scenario, true_state)
    around = signals | {"joint_state": true_state} | hand
    forces = add_forces(builder, arm, scenario, law.linearization.layout, around)
    if needs_sensor(scenario):
        arm.require_reaction_forces()
        forces |= add_sensor(builder, arm.model, chain, arm.tool, scenario, joint_state)
    controller, made = add_law(builder, task, place, forces)
    signals |= forces | made
    drive = {"drive": controller.GetOutputPort(controller.drive_port)}
    signals |= add_drives(builder, arm, scenario, signals | drive, initial_state)
    signals |= add_friction(builder, arm, true_state, scenario, folder)
    signals |= states_to_log(scenario, true_state, joint_state)
    log = add_log(builder, signals, period)
    diagram = builder.Build()
    diagram.set_name(scenario.name or "path_following")
    return PathFollowingStation(
        diagram,
        arm.plant,
        chain,
        coordinates,
        path,
        law,
        place.projector,
        controller,
        log,
        task.progress.domain[1],
        initial_state,
        initial_theta,
        on_motors,
        arm.warnings
        + posture_warnings(
            scenario.start.posture_deg,
            chain,
            (coordinates.link_rows @ initial_state)[: chain.dimension],
            path.orientation is not None,
        )
        + law_warnings(scenario, chain, coordinates.link_rows @ initial_state)
        + sensor_warnings(scenario),
        arm,
    )
