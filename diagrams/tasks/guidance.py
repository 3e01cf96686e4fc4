"""The reference of a tool that is led by hand, within virtual fixtures."""

import casadi as ca
import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import Scenario
from diagrams.scenario.fixtures import FixtureParameters
from diagrams.tasks.space_guidance import SpaceTask, free_motion, make_lead
from pfsc_drake.blocks.wiring_blocks import Linear
from pfsc_drake.control.compliance.tuned_impedance import WISHES, wishes_of
from pfsc_drake.control.fixtures.fixture_guidance import FixtureGuidance, LedTool
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.labels import Mode
from pfsc_drake.control.fixtures.lead import ServoLead
from pfsc_drake.control.fixtures.near_rows import near_rows, reaches
from pfsc_drake.control.fixtures.nearby import ScheduledRegions
from pfsc_drake.control.fixtures.printed import PrintedGuidance
from pfsc_drake.control.fixtures.program import MOST_NEAR
from pfsc_drake.control.fixtures.robot_limits import RobotLimits
from pfsc_drake.control.fixtures.soft_region import bearable_stiffness
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import Kind
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.control.near_regions import NearRegions

# names of the values of the logged signal ``mode``
MODES = tuple(mode.name.lower() for mode in Mode)


def add_guidance(
    builder: DiagramBuilder,
    scenario: Scenario,
    robot: RobotModel,
    task: SpaceTask,
    order: int,
    ports: dict[str, OutputPort],
    start: np.ndarray,
) -> BlockSystem:
    """Add what leads the tool.

    Args:
        builder: Builder of the diagram.
        scenario: The scenario.
        robot: The robot as it is believed.
        task: Leading it through space.
        order: Highest derivative of the reference that is needed.
        ports: ``joint_state`` as measured; ``wrench_measured`` and ``tared``, or without a sensor
            ``wrench_observed`` and ``ready``; where a person can change them, ``regions_on`` and
            ``impedance_wish``, see :class:`ImpedanceTuner`.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: If the rules do not suit the law.
    """
    period = scenario.controller.sampling_time
    guidance = make_guidance(scenario, task, robot, order, start)
    system = builder.AddNamedSystem("fixture_guidance", BlockSystem(guidance, period))
    if guidance.tool.near is None:
        regions = scheduled_regions(scenario, task)
        near = builder.AddNamedSystem(
            "near_regions", NearRegions(regions, len(task.fixtures), period)
        )
        builder.Connect(system.GetOutputPort("place"), near.GetInputPort("place"))
        builder.Connect(near.GetOutputPort("near"), system.GetInputPort("near"))
        if "regions_on" in ports:
            builder.Connect(ports["regions_on"], near.GetInputPort("active"))
    wrench, ready = "wrench_measured", "tared"
    if scenario.compliance.source == "observed":
        wrench, ready = "wrench_observed", "ready"
    builder.Connect(ports["joint_state"], system.GetInputPort("joint_state"))
    builder.Connect(ports[wrench], system.GetInputPort("wrench"))
    builder.Connect(ports[ready], system.GetInputPort("ready"))
    if "regions_on" in ports:
        builder.Connect(ports["regions_on"], system.GetInputPort("active"))
    if "impedance_wish" in ports:
        picked = np.zeros((1, WISHES))
        _, place = wishes_of(Kind.TANGENTIAL)
        picked[0, place] = 1.0
        period = scenario.controller.sampling_time
        damping = builder.AddNamedSystem("free_damping", BlockSystem(Linear(picked), period))
        builder.Connect(ports["impedance_wish"], damping.GetInputPort("vector"))
        builder.Connect(damping.GetOutputPort("product"), system.GetInputPort("damping"))
    return system


def _robot_limits(
    scenario: Scenario, robot: RobotModel, task: SpaceTask, start: np.ndarray
) -> RobotLimits | None:
    """Return what of the robot limits the hand, if anything is to."""
    parameters, place = scenario.fixtures or FixtureParameters(), task.place
    if not parameters.limits.on or parameters.guidance.rules == "printed":
        return None
    return RobotLimits(
        robot,
        parameters.limits,
        start,
        oriented=place.is_oriented,
        tool_axis=place.tool.tool_axis,
        yaw_axis=place.tool.yaw_axis,
        fastest=parameters.guidance.largest_speed + max(task.region_speeds, default=0.0),
    )


def make_guidance(
    scenario: Scenario, task: SpaceTask, robot: RobotModel, order: int, start: np.ndarray
) -> FixtureGuidance:
    """Return the rules that lead a scenario's tool.

    Args:
        scenario: The scenario.
        task: Leading it through space.
        robot: The robot as it is believed.
        order: Highest derivative of the reference that is needed.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: If the rules do not suit the law.
    """
    parameters, lead = (scenario.fixtures or FixtureParameters()).guidance, task.lead
    tool = LedTool(
        tool_motion_function(robot),
        lead,
        free_motion(scenario),
        len(task.fixtures),
        near_expression(scenario, task),
        order,
        len(task.manifold.coordinates),
    )
    if parameters.rules == "printed":
        if not isinstance(lead, ServoLead):
            raise InputError(
                f"fixtures.guidance.rules = printed: controller.law = {scenario.controller.law}; "
                "must be velocity_servo, as in Sec. 5.2.4"
            )
        return PrintedGuidance(tool, parameters.printed)
    stiffness = [fixture.stiffness for fixture in task.fixtures]
    limits = _robot_limits(scenario, robot, task, start)
    return ProgramGuidance(tool, parameters, stiffness, limits)


def near_expression(scenario: Scenario, task: SpaceTask) -> ca.Function | None:
    """Return what is near as an expression; None where that takes a schedule of distances.

    Many regions do, those whose distances are bounded in number, and what has no formula.

    Args:
        scenario: The scenario.
        task: Leading it through space.
    """
    parameters = scenario.fixtures or FixtureParameters()
    if len(task.fixtures) > MOST_NEAR or parameters.looks:
        return None
    period = scenario.controller.sampling_time
    within = reaches(parameters.guidance, period, task.region_speeds)
    try:
        return near_rows([fixture.region for fixture in task.fixtures], within)
    except InputError:  # a fitted surface of many pieces
        return None


def scheduled_regions(scenario: Scenario, task: SpaceTask) -> ScheduledRegions:
    """Return the schedule of many distances.

    Args:
        scenario: The scenario.
        task: Leading it through space.
    """
    parameters = scenario.fixtures or FixtureParameters()
    return ScheduledRegions(
        [fixture.region for fixture in task.fixtures],
        parameters.guidance,
        scenario.controller.sampling_time,
        speeds=task.region_speeds,
        looks=parameters.looks or None,
    )


def stiff_regions(scenario: Scenario) -> list[str]:
    """Return which soft regions may ring behind servos, one sentence each.

    Args:
        scenario: The scenario.
    """
    fixtures, servos = scenario.fixtures, RELATIVE_DEGREE[scenario.controller.law] == 1
    if fixtures is None or not servos or scenario.controller.manifold != "space":
        return []
    motion, lag = free_motion(scenario), make_lead(scenario).lag
    most = bearable_stiffness(motion, lag)
    return [
        f"fixtures.regions[{number}].stiffness = {region.stiffness:g} N/m: compliance.tangential "
        f"with {motion.damping:g} N s/m bears {most:.2g} N/m where servos and bus, "
        f"{1e3 * lag:.2g} ms, are later than believed by a fifth or a tick; a stiffer region may "
        "ring: make it softer or hard, or the damping larger"
        for number, region in enumerate(fixtures.regions)
        if region.stiffness is not None and region.stiffness > most
    ]
