"""Reference of a hand-guided tool within virtual fixtures (Sec. 5.1.1, 5.2.4)."""

import casadi as ca
import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.blocks.wiring_blocks import Linear
from pfsc_drake.control.compliance.impedance_parameters import Profile
from pfsc_drake.control.compliance.tuned_impedance import REQUESTS, requests_of
from pfsc_drake.control.fixtures.command_dynamics import (
    CommandDynamics,
    FilterDynamics,
    ServoDynamics,
)
from pfsc_drake.control.fixtures.contact_program import MOST_NEAR
from pfsc_drake.control.fixtures.fixture_guidance import FixtureGuidance, GuidedTool
from pfsc_drake.control.fixtures.fixture_parameters import Admittance
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.guides import GuidePaths
from pfsc_drake.control.fixtures.near_regions import ScheduledRegions, near_rows, reaches
from pfsc_drake.control.fixtures.robot_limits import RobotLimits
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.controller.compliance import force_ports
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.follower_options import FixtureOptions
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.near_regions_system import NearRegions


def free_motion(compliance: ComplianceParameters, period: float) -> Admittance:
    """Return the admittance of a hand-guided tool in space.

    Args:
        compliance: Compliance of the tool.
        period: Sampling time [s].

    Raises:
        InputError: If an operator could not move the tool.
    """
    along = compliance.tangential
    mass, damping, stiffness = along.mass, along.damping, along.stiffness
    free = not stiffness.at and stiffness.value == 0.0
    constant = isinstance(damping, Profile) and not (mass.at or damping.at)
    if not (free and constant and isinstance(damping, Profile) and damping.value > 0.0):
        raise InputError(
            "compliance.tangential: controller.manifold = space needs a constant mass, a constant "
            "positive damping, and stiffness: {value: 0}, so that an operator can guide the tool"
        )
    return Admittance(mass.value, damping.value, period)


def make_command_dynamics(
    relative_degree: int, options: FixtureOptions, period: float, *, lag: float, delay: float
) -> CommandDynamics:
    """Return the dynamics between the commanded velocity and the tool.

    Args:
        relative_degree: r of the law.
        options: Options of the fixtures.
        period: Sampling time [s].
        lag: Lag of velocity servos [s], for r = 1.
        delay: Delay of their commands [s].
    """
    if relative_degree > 1:
        return FilterDynamics(relative_degree, options.smoothing, period)
    return ServoDynamics(lag, delay, period)


def add_fixture_guidance(
    builder: DiagramBuilder,
    task: SpaceTask,
    compliance: ComplianceParameters,
    robot: RobotModel,
    order: int,
    ports: dict[str, OutputPort],
    start: np.ndarray,
) -> BlockSystem:
    """Add the hand guiding of a tool.

    Args:
        builder: Builder of the diagram.
        task: Task of the tool.
        compliance: Source of the forces that guide it.
        robot: Nominal model of the robot.
        order: Highest derivative of the reference that is needed.
        ports: ``joint_state`` as measured, and those of :func:`force_ports`; with changes by
            an operator also ``regions_on`` and ``impedance_request``, see :class:`ImpedanceTuner`.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: If the rules do not suit the law.
    """
    period, count = task.admittance.period, len(task.fixtures)
    guidance = make_guidance(task, robot, order, start)
    system = builder.AddNamedSystem("fixture_guidance", BlockSystem(guidance, period))
    if guidance.tool.near is None:
        regions = NearRegions(scheduled_regions(task), count, period)
        near = builder.AddNamedSystem("near_regions", regions)
        builder.Connect(
            system.GetOutputPort("evaluation_point"), near.GetInputPort("evaluation_point")
        )
        builder.Connect(near.GetOutputPort("near"), system.GetInputPort("near"))
        if "regions_on" in ports:
            of_regions = np.eye(count, guidance.tool.num_switches)
            only = builder.AddNamedSystem("regions_on", BlockSystem(Linear(of_regions), period))
            builder.Connect(ports["regions_on"], only.GetInputPort("vector"))
            builder.Connect(only.GetOutputPort("product"), near.GetInputPort("active"))
    wrench, ready = force_ports(compliance, ports)
    builder.Connect(ports["joint_state"], system.GetInputPort("joint_state"))
    builder.Connect(wrench, system.GetInputPort("wrench"))
    builder.Connect(ready, system.GetInputPort("ready"))
    if "regions_on" in ports:
        builder.Connect(ports["regions_on"], system.GetInputPort("active"))
    if "impedance_request" in ports:
        picked = np.zeros((1, REQUESTS))
        _, index = requests_of(Kind.TANGENTIAL)
        picked[0, index] = 1.0
        damping = builder.AddNamedSystem("free_damping", BlockSystem(Linear(picked), period))
        builder.Connect(ports["impedance_request"], damping.GetInputPort("vector"))
        builder.Connect(damping.GetOutputPort("product"), system.GetInputPort("damping"))
    return system


def make_guidance(
    task: SpaceTask, robot: RobotModel, order: int, start: np.ndarray
) -> FixtureGuidance:
    """Return the rules of hand guiding.

    Args:
        task: Task of the tool.
        robot: Nominal model of the robot.
        order: Highest derivative of the reference that is needed.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: If the rules do not suit the law.
    """
    parameters = task.options.guidance
    tool = GuidedTool(
        tool_motion_function(robot),
        task.command_dynamics,
        task.admittance,
        len(task.fixtures),
        near_expression(task),
        order,
        len(task.projected_manifold.coordinates),
        GuidePaths([*task.guides.values()], task.admittance.period) if task.guides else None,
    )
    stiffness = [fixture.stiffness for fixture in task.fixtures]
    return ProgramGuidance(tool, parameters, stiffness, _robot_limits(task, robot, start))


def _robot_limits(task: SpaceTask, robot: RobotModel, start: np.ndarray) -> RobotLimits | None:
    """Return the robot's limits for hand guiding, if they are switched on."""
    options, manifold = task.options, task.projected_manifold
    if not options.limits.on:
        return None
    return RobotLimits(
        robot,
        options.limits,
        start,
        oriented=manifold.is_oriented,
        tool_axis=manifold.tool.tool_axis,
        yaw_axis=manifold.tool.yaw_axis,
        fastest=options.guidance.largest_speed + max(task.speeds, default=0.0),
    )


def near_expression(task: SpaceTask) -> ca.Function | None:
    """Return near regions as an expression; None if their distances need a schedule.

    Many regions need one, a limited number of distance evaluations, and regions without formula.

    Args:
        task: Task of the tool.
    """
    options = task.options
    if len(task.fixtures) > MOST_NEAR or options.distance_evaluations:
        return None
    within = reaches(options.guidance, task.admittance.period, task.speeds)
    try:
        return near_rows([fixture.region for fixture in task.fixtures], within)
    except InputError:  # a fitted surface of many pieces
        return None


def scheduled_regions(task: SpaceTask) -> ScheduledRegions:
    """Return the schedule of many distances.

    Args:
        task: Task of the tool.
    """
    options = task.options
    return ScheduledRegions(
        [fixture.region for fixture in task.fixtures],
        options.guidance,
        task.admittance.period,
        speeds=task.speeds,
        budget=options.distance_evaluations or None,
    )
