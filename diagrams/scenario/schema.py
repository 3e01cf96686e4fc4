"""Schema of a scenario file, and its reduction for a robot in another process.

Lengths in m, angles in rad unless a name ends in ``_deg``, times in s.
"""

import dataclasses as dc
from copy import deepcopy

from diagrams.scenario.holder import HolderParameters
from diagrams.scenario.manifolds import PathParameters, SurfaceParameters
from diagrams.scenario.model_error import ModelErrorParameters
from diagrams.scenario.motion import ReferenceParameters, StartParameters
from diagrams.scenario.obstacles import CrossingParameters
from diagrams.scenario.plate import PlateParameters
from diagrams.scenario.robot import (
    DriverParameters,
    RobotParameters,
    SensorParameters,
    ServoParameters,
)
from diagrams.scenario.simulation import (
    HoldBackParameters,
    OperatorParameters,
    SimulationParameters,
)
from diagrams.scenario.streamed import Streamed
from diagrams.scenario.teleoperation import TeleoperationParameters
from diagrams.scenario.turntable import TurntableParameters
from diagrams.scenario.virtual_fixtures import FixtureParameters
from diagrams.scenario.workpiece import NotchParameters, WorkpieceParameters
from pfsc_drake.checks import require, require_one_of
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.follower_options import FaultParameters
from pfsc_drake.controller.options.friction_parameters import JointFrictionParameters
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.physics.link_forces import LinkHandParameters
from pfsc_drake.physics.scripted_force import ForcePulse
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive


@dc.dataclass
class Target:
    """Target of a metric.

    Attributes:
        bound: Comparison and number in SI units, e.g. ``< 5e-5``.
        source: Source of the target.
    """

    bound: str = ""
    source: str = ""


@dc.dataclass
class Scenario(Parameters):
    """A run: a robot, a task and an environment.

    Attributes:
        name: Name of the scenario.
        section: Section of the dissertation.
        description: One line.
        robot: The robot.
        path: The path.
        surface: The surface, for ``controller.manifold: surface`` or a path on it.
        fixtures: Regions that the tool may not enter, for ``controller.manifold: space``.
        controller: The controller.
        model_error: Errors of the controller's nominal model of the robot.
        reference: Motion along the path.
        start: Start of the tool.
        simulation: Integration, recording and sensor failures.
        forces: Wrenches on the tool, or on a link, over time.
        pushes: Hands that hold links and move them.
        hand: An operator's hand on the tool, in addition to the forces; none without the block
            or with ``hand: null``.
        operator: A person who guides the tool while the robot moves, in a live session or recorded
            in one. None without the block.
        teleoperation: Leader device and channel, by which hand or person command the tool from a
            distance. None without the block: they are at the tool.
        hold_back: A wrench that only slows the robot down.
        servo: Velocity controllers of the joints, for the law ``velocity_servo``.
        driver: Driver between a law that commands torques and the drives.
        friction: Friction of the joints.
        drive_friction: Whether the drives have the friction of the robot's own parameters, which
            DELTA robots have; null for true if ``friction`` is empty.
        encoders: Encoder model: resolution, filter and differentiation of joint positions.
        compliance: Compliance of the tool under measured forces.
        sensor: The force/torque sensor that measures them.
        faults: Fault detection and stops.
        notch: Workpiece with a notch along the path, and a ball on the tool that runs in it; it
            starts in the middle of the notch, displaced by ``start.offset``. None without the
            block.
        workpiece: Workpiece under the surface, and a ball on the tool that presses on it. None
            without the block.
        holder: Workpiece robot: a second robot, which holds the workpiece with the path. None
            without the block.
        turntable: Turntable that carries the workpiece with the path. None without the block.
        plate: Plate with pins that a gripper takes from a magazine and mounts into a frame. None
            without the block.
        obstacles: Obstacles that cross the path, for which progress waits. None without the block.
        duration: Simulated time [s]; 0 for the length of the reference.
        judged_after: Simulated time from which on targets are checked; a shorter run does not check
            them [s]; 0 for ``duration``.
        settling_tolerance: Distance from the path that counts as converged [m].
        targets: Targets of metrics, by metric; under a law's name for that law only.
    """

    name: str = ""
    section: str = ""
    description: str = ""
    robot: RobotParameters = dc.field(default_factory=RobotParameters)
    path: PathParameters = dc.field(default_factory=PathParameters)
    surface: SurfaceParameters | None = None
    fixtures: FixtureParameters | None = None
    controller: ControllerParameters = dc.field(default_factory=ControllerParameters)
    model_error: ModelErrorParameters = dc.field(default_factory=ModelErrorParameters)
    reference: ReferenceParameters = dc.field(default_factory=ReferenceParameters)
    start: StartParameters = dc.field(default_factory=StartParameters)
    simulation: SimulationParameters = dc.field(default_factory=SimulationParameters)
    forces: list[ForcePulse] = dc.field(default_factory=list)
    pushes: list[LinkHandParameters] = dc.field(default_factory=list)
    hand: HandParameters | None = None
    operator: OperatorParameters | None = None
    teleoperation: TeleoperationParameters | None = None
    hold_back: HoldBackParameters = dc.field(default_factory=HoldBackParameters)
    servo: ServoParameters = dc.field(default_factory=ServoParameters)
    driver: DriverParameters = dc.field(default_factory=DriverParameters)
    friction: JointFrictionParameters = dc.field(default_factory=JointFrictionParameters)
    drive_friction: bool | None = None
    encoders: EncoderOptions = dc.field(default_factory=EncoderOptions)
    compliance: ComplianceParameters = dc.field(default_factory=ComplianceParameters)
    sensor: SensorParameters = dc.field(default_factory=SensorParameters)
    faults: FaultParameters = dc.field(default_factory=FaultParameters)
    notch: NotchParameters | None = None
    workpiece: WorkpieceParameters | None = None
    holder: HolderParameters | None = None
    turntable: TurntableParameters | None = None
    plate: PlateParameters | None = None
    obstacles: CrossingParameters | None = None
    duration: NotNegative = 0.0
    judged_after: NotNegative = 0.0
    settling_tolerance: Positive = 1e-4
    targets: dict[str, dict[str, Target]] = dc.field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        plain = not set(self.name) & set("/\\:") and self.name not in (".", "..")
        require(plain, "name", self.name, "a name without slashes and colons")
        for law in self.targets:
            require_one_of("targets", law, RELATIVE_DEGREE)

    @property
    def switched_regions(self) -> list[str]:
        """Names of the regions, and then guides, that a person can switch on and off one by one."""
        if self.controller.manifold != "space" or self.fixtures is None:
            return []
        return self.fixtures.names + self.fixtures.guide_names

    @property
    def encoder_period(self) -> float:
        """Sampling time of the encoders, which servos may read more often than the law [s]."""
        period = self.controller.sampling_time
        has_servos = not self.controller.law_record.commands_torque
        return self.servo.period or period if has_servos else period

    @property
    def needs_sensor(self) -> bool:
        """Whether measured forces are used."""
        controllers = [self.controller] + ([] if self.holder is None else [self.holder.controller])
        measured = any(each.external_torque.source == "measured" for each in controllers)
        return measured or self.compliance.needs_sensor


# blocks of the plant and its environment
_OF_THE_PLANT = (
    "forces",
    "pushes",
    "hand",
    "hold_back",
    "friction",
    "drive_friction",
    "notch",
    "workpiece",
)
_ONE_SIDE = "from_torque or observed: a robot measures one side of its joints"
_TRANSITION = 0.5  # s


# drivers limit the rate of torques: a stop with larger torques would oscillate
_STOP_SHARE, _HOLD_BANDWIDTH = 0.35, 40.0
# with springs between drives and links, so that a stop tolerates two ticks of unmodelled delay
_HOLD_OF_SPRINGS = 20.0


def driven(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """Return a scenario without the blocks of the plant, and the changes, one sentence each.

    Args:
        scenario: The scenario.

    Raises:
        InputError: If it needs quantities that only a simulation has.
    """
    left, plain = deepcopy(scenario), Scenario()
    for key in ("plate", "operator", "holder", "turntable"):
        absent = getattr(scenario, key) is None
        require(absent, key, "given", "null where the robot is in another process")
    if scenario.teleoperation is not None:
        bus = scenario.teleoperation.lcm
        require(bool(bus), "teleoperation.lcm", repr(bus), "the bus of a leader (lead)")
    controller = scenario.controller
    finds_links = not controller.law_record.knows_links or controller.state != "measured"
    require(finds_links, "controller.state", controller.state, _ONE_SIDE)
    known = not isinstance(scenario.path.shape, Streamed)
    beforehand = "a path that is known beforehand, where the robot is in another process"
    require(known, "path.shape", "!Streamed", beforehand)
    source = scenario.controller.external_torque.source
    allowed = "none, measured or observed; forces are known in simulation only"
    require(source != "known", "controller.external_torque.source", source, allowed)
    ignored = [key for key in _OF_THE_PLANT if getattr(scenario, key) != getattr(plain, key)]
    for key in ignored:
        setattr(left, key, getattr(plain, key))
    if scenario.encoders != plain.encoders:
        ignored.append("encoders")
    for key in ("sensor_failure", "force_sensor_failure"):
        if getattr(scenario.simulation, key) != getattr(plain.simulation, key):
            setattr(left.simulation, key, getattr(plain.simulation, key))
            ignored.append(f"simulation.{key}")
    changes = []
    if scenario.teleoperation is not None and "hand" in ignored:
        ignored.remove("hand")
        changes.append("left to the leader: hand")
    if ignored:
        changes.append(f"left to the robot: {', '.join(ignored)}")
    if scenario.obstacles is not None:
        changes.append(
            "obstacles.moving, obstacles.sensor: messages report the obstacles; without them there "
            "are none"
        )
    faults = left.faults
    rigid = not controller.law_record.knows_links
    holding = _HOLD_BANDWIDTH if rigid else _HOLD_OF_SPRINGS
    if faults.effort_share > _STOP_SHARE or faults.hold_bandwidth > holding:
        faults.effort_share = min(faults.effort_share, _STOP_SHARE)
        faults.hold_bandwidth = min(faults.hold_bandwidth, holding)
        changes.append(
            f"faults.effort_share = {faults.effort_share:g}, faults.hold_bandwidth = "
            f"{faults.hold_bandwidth:g} rad/s: the robot's driver limits the rate of torques"
        )
    if not rigid and controller.delay is None:
        left.controller.delay = controller.sampling_time
        changes.append(
            f"controller.delay = {controller.sampling_time:g} s: a link to a robot takes a tick"
        )
    if left.start.transition == 0.0 and left.controller.manifold != "space":
        left.start.transition = _TRANSITION
        changes.append(f"start.transition = {_TRANSITION:g} s: a robot starts smoothly")
    return left, changes
