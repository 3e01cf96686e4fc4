"""The reference of a tool that is led by hand, within virtual fixtures."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain

from diagrams.scenario import Scenario
from diagrams.scenario.fixtures import FixtureParameters
from diagrams.tasks.space_guidance import SpaceTask, free_motion
from pfsc_drake.control.compliance.tuned_impedance import WISHES, wishes_of
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.labels import Mode
from pfsc_drake.control.fixtures.lead import FilterLead, Lead, ServoLead
from pfsc_drake.control.fixtures.nearby import ScheduledRegions
from pfsc_drake.control.fixtures.printed import PrintedGuidance
from pfsc_drake.control.fixtures.record import GuidanceRecord
from pfsc_drake.control.fixtures.robot_limits import RobotLimits
from pfsc_drake.control.fixtures.soft_region import bearable_stiffness
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import Kind
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.control.fixture_guidance import FixtureGuidance, Guidance

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
) -> FixtureGuidance:
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
    period, record = scenario.controller.sampling_time, GuidanceRecord(len(task.fixtures))
    system = builder.AddNamedSystem(
        "fixture_guidance",
        FixtureGuidance(
            make_guidance(scenario, task),
            robot,
            order,
            len(task.manifold.coordinates),
            record,
            period,
            _robot_limits(scenario, robot, task, start),
        ),
    )
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
        damping = builder.AddNamedSystem("free_damping", MatrixGain(picked))
        builder.Connect(ports["impedance_wish"], damping.get_input_port())
        builder.Connect(damping.get_output_port(), system.GetInputPort("damping"))
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


def make_guidance(scenario: Scenario, task: SpaceTask) -> Guidance:
    """Return the rules that lead a scenario's tool.

    Args:
        scenario: The scenario.
        task: Leading it through space.

    Raises:
        InputError: If the rules do not suit the law.
    """
    parameters = scenario.fixtures or FixtureParameters()
    admittance, period = free_motion(scenario), scenario.controller.sampling_time
    regions = [fixture.region for fixture in task.fixtures]
    nearby = ScheduledRegions(
        regions,
        parameters.guidance,
        period,
        speeds=task.region_speeds,
        looks=parameters.looks or None,
    )
    lead = make_lead(scenario)
    if parameters.guidance.rules == "printed":
        if not isinstance(lead, ServoLead):
            raise InputError(
                f"fixtures.guidance.rules = printed: controller.law = {scenario.controller.law}; "
                "must be velocity_servo, as in Sec. 5.2.4"
            )
        return PrintedGuidance(parameters.guidance.printed, admittance, lead, nearby)
    stiffness = [fixture.stiffness for fixture in task.fixtures]
    return ProgramGuidance(parameters.guidance, admittance, lead, nearby, stiffness)


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


def make_lead(scenario: Scenario) -> Lead:
    """Return what is between the velocity that is asked for and the tool.

    Args:
        scenario: The scenario.
    """
    parameters = scenario.fixtures or FixtureParameters()
    period, degree = scenario.controller.sampling_time, RELATIVE_DEGREE[scenario.controller.law]
    if degree > 1:
        return FilterLead(degree, parameters.smoothing, period)
    lag = parameters.lag_behind(scenario.servo.bandwidth)
    return ServoLead(lag, scenario.servo.bus_delay, period)
