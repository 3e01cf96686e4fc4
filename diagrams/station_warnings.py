"""What is said beforehand of the controller that a scenario chooses."""

from functools import cache

import numpy as np

from diagrams.robots.force_sensor import taring_warnings
from diagrams.robots.part import RobotPart
from diagrams.scenario import Scenario
from diagrams.warnings.part_warnings import (
    coarse_encoders,
    firm_guides,
    obstacle_warnings,
    rest_warnings,
    stiff_fixtures,
)
from diagrams.warnings.sensed_load import SensorLoop, sensed_load_warnings
from diagrams.warnings.untold_forces import (
    ExpectedForces,
    bearable_way,
    largest_force,
    untold_forces,
    untold_friction,
)
from pfsc_drake.controller.controller import Controller
from pfsc_drake.controller.law_warnings import (
    law_warnings,
    observed_force_warnings,
    servo_warnings,
    unused_parameters,
)
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.physics.operator_hand import LiveHandParameters


def controller_warnings(scenario: Scenario, part: RobotPart, controller: Controller) -> list[str]:
    """Return doubts about a scenario's controller, one sentence each.

    Args:
        scenario: The scenario.
        part: The robot.
        controller: The controller.
    """
    parameters, robot, task = scenario.controller, part.belief.robot, controller.task
    law, rest, sampled = controller.law, controller.rest, cache(controller.sampled)
    link_state = np.append(controller.start_posture, np.zeros(robot.dimension))
    bearable = bearable_way(parameters.manifold, scenario.fixtures, scenario.compliance)
    said = law_warnings(parameters, robot, law, link_state, sampled)
    if not parameters.law_record.commands_torque:
        said += servo_warnings(scenario.servo.bandwidth, robot, link_state)
    q_J, period = link_state[: robot.dimension], parameters.sampling_time
    said += coarse_encoders(scenario.encoders, period, robot, law, q_J)
    said += untold_forces(
        expected_forces(scenario), bearable, parameters, robot, law, rest, sampled
    )
    if scenario.friction.is_given:
        said += untold_friction(bearable, parameters, law)
    said += observed_force_warnings(scenario.compliance, robot, law, rest)
    said += obstacle_warnings(scenario.obstacles)
    said += rest_warnings(scenario.teleoperation, scenario.hand, scenario.duration)
    said += unused_parameters(parameters, law)
    if scenario.fixtures is not None and isinstance(task, SpaceTask):
        said += stiff_fixtures(scenario.fixtures, task)
        said += firm_guides(task.guides, [hand.force_limit for hand in _hands(scenario)])
    if scenario.needs_sensor:
        if scenario.compliance.needs_sensor:
            said += taring_warnings(scenario.sensor.taring_time, scenario.reference.dwell)
        load = part.believed_load(scenario.sensor.joint)
        said += sensed_load_warnings(sensor_loop(scenario), robot, load, law, rest)
    return said


def expected_forces(scenario: Scenario) -> ExpectedForces:
    """Return the forces from outside that a scenario tells beforehand.

    Args:
        scenario: The scenario.
    """
    hands = [] if scenario.teleoperation is not None else _hands(scenario)
    return ExpectedForces(
        largest_force(scenario.forces, hands),
        bool(scenario.pushes) or any(pulse.link for pulse in scenario.forces),
        scenario.hold_back.force != 0.0,
    )


def _hands(scenario: Scenario) -> list[HandParameters | LiveHandParameters]:
    """Return the hands that act on the tool."""
    hands = [scenario.hand, scenario.operator and scenario.operator.hand]
    return [hand for hand in hands if hand]


def sensor_loop(scenario: Scenario) -> SensorLoop:
    """Return a scenario's force sensor and what answers to it.

    Args:
        scenario: The scenario.
    """
    return SensorLoop(
        scenario.sensor,
        scenario.compliance,
        scenario.encoders,
        scenario.controller,
        scenario.servo,
    )
