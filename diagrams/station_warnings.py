"""Warnings before a run about the controller of a scenario."""

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
from diagrams.warnings.unmodelled_forces import (
    ExpectedForces,
    largest_force,
    tolerable_deflection,
    uncompensated_friction,
    unmodelled_forces,
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
    """Return warnings about a scenario's controller, one sentence each.

    Args:
        scenario: The scenario.
        part: The robot.
        controller: The controller.
    """
    parameters, robot, task = scenario.controller, part.nominal_model.robot, controller.task
    law, rest, sampled = controller.law, controller.rest, cache(controller.sampled_loop)
    link_state = np.append(controller.start_posture, np.zeros(robot.dimension))
    tolerable = tolerable_deflection(parameters.manifold, scenario.fixtures, scenario.compliance)
    warnings = law_warnings(parameters, robot, law, link_state, sampled)
    if not parameters.law_record.commands_torque:
        warnings += servo_warnings(scenario.servo.bandwidth, robot, link_state)
    q_J, period = link_state[: robot.dimension], parameters.sampling_time
    warnings += coarse_encoders(scenario.encoders, period, robot, law, q_J)
    warnings += unmodelled_forces(
        expected_forces(scenario), tolerable, parameters, robot, law, rest, sampled
    )
    if scenario.friction.is_given:
        warnings += uncompensated_friction(tolerable, parameters, law)
    warnings += observed_force_warnings(scenario.compliance, robot, law, rest)
    warnings += obstacle_warnings(scenario.obstacles)
    warnings += rest_warnings(scenario.teleoperation, scenario.hand, scenario.duration)
    warnings += unused_parameters(parameters, law)
    if scenario.fixtures is not None and isinstance(task, SpaceTask):
        warnings += stiff_fixtures(scenario.fixtures, task)
        warnings += firm_guides(task.guides, [hand.force_limit for hand in _hands(scenario)])
    if scenario.needs_sensor:
        if scenario.compliance.needs_sensor:
            warnings += taring_warnings(scenario.sensor.taring_time, scenario.reference.dwell)
        load = part.nominal_load(scenario.sensor.joint)
        warnings += sensed_load_warnings(sensor_loop(scenario), robot, load, law, rest)
    return warnings


def expected_forces(scenario: Scenario) -> ExpectedForces:
    """Return the external forces that a scenario specifies.

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
    """Return the loop over a scenario's force sensor.

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
