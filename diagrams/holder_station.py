"""The robot of a station that holds the workpiece, with its controller."""

import dataclasses as dc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, OutputPort, System

from diagrams.controlled_robot import ControlledRobot, add_controlled_robot
from diagrams.robots.arm import Arm, add_arm
from diagrams.robots.drives import add_drives
from diagrams.robots.model import is_delta
from diagrams.robots.plant_friction import add_friction
from diagrams.scenario import DriverParameters, HolderParameters, Scenario
from diagrams.scenario.pair import holder_scenario
from diagrams.scenario_task import check_joints, make_task
from diagrams.signal_log import SignalLog
from diagrams.station_options import StationOptions
from diagrams.station_start import find_start
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.checks import require
from pfsc_drake.control.estimation.reaction import Reaction
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.controller.carrier import Derivatives, MeasuredReaction, WorkpieceFrame
from pfsc_drake.controller.fault_description import FaultReport
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import BlockAccess

# beginning of the names of all systems and signals of the robot that holds the workpiece
HOLDER = "holder_"
_WHO = "the robot that holds the workpiece"


class PrefixingBuilder(DiagramBuilder):
    """Builder that adds systems to another builder, a prefix before their names.

    Args:
        builder: Builder that receives the systems.
        prefix: Beginning of their names.
    """

    def __init__(self, builder: DiagramBuilder, prefix: str) -> None:
        super().__init__()
        self._builder, self._prefix = builder, prefix

    def AddNamedSystem(self, name: str, system: System) -> System:
        """Add a system under its prefixed name, and return it."""
        return self._builder.AddNamedSystem(self._prefix + name, system)

    def Connect(self, output: OutputPort, input: InputPort) -> None:
        """Connect two ports of the other builder's systems."""
        self._builder.Connect(output, input)


@dataclass
class Holder:
    """A robot that holds the workpiece.

    Attributes:
        robot: The robot, whose tool frame is the workpiece's, with its controller.
        parameters: Its parameters in the scenario.
        signals: Signals for the log, by names with the prefix.
        reaction: Reaction of the process on the workpiece, its inputs open, if there is one.
    """

    robot: ControlledRobot
    parameters: HolderParameters
    signals: dict[str, OutputPort]
    reaction: BlockSystem | None = None

    @property
    def part(self) -> Arm:
        """The robot alone."""
        return cast(Arm, self.robot.part)

    @property
    def law(self) -> FollowingLaw:
        """Law of its controller."""
        return self.robot.controller.law

    @cached_property
    def frame(self) -> np.ndarray:
        """Pose of the workpiece at the start, ``[p_WC, R_WC by rows]``, shape (12,)."""
        return np.array(pose_function(self.part.robot)(self.robot.start_posture)).ravel()

    @cached_property
    def planned(self) -> PiecewisePolynomialCurve:
        """Planned motion of the workpiece over time."""
        return self.robot.controller.planned_frame(_placement(self.parameters))

    def found_fault(self, log: SignalLog, blocks: BlockAccess, root: Context) -> FaultReport | None:
        """Return the cause of a stop by the controller, or None.

        Args:
            log: Log of the station.
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        found = self.robot.found_fault(log.of(HOLDER), blocks, root)
        return found and FaultReport(f"{_WHO}: {found.sentence}", found.time)

    def warnings(self) -> list[str]:
        """Return warnings about the robot and its controller, one sentence each."""
        return [f"{_WHO}: {line}" for line in self.robot.warnings()]


def add_holder(
    builder: DiagramBuilder,
    station: StationOptions,
    order: int,
    like: Holder | None = None,
) -> Holder:
    """Add the robot that holds the workpiece of a scenario, with its controller.

    All of its systems have names that begin with ``holder_``.

    Args:
        builder: Builder of the diagram.
        station: Options of the station, whose scenario has such a robot.
        order: Relative degree of the other robot's law, which needs the motion.
        like: Robot that differs in the integration only, if it has been built.

    Raises:
        InputError: If it cannot be built, or does not suit the other robot.
    """
    scenario, folder = station.scenario, station.folder
    holder, own = scenario.holder, holder_scenario(scenario)
    assert holder is not None
    chosen = StationOptions(own, folder)
    model = scenario.robot.model
    require(not is_delta(model), "robot.model", model, "a serial arm, with a workpiece robot")
    named, before = PrefixingBuilder(builder, HOLDER), None if like is None else like.robot
    period, reacts = scenario.controller.sampling_time, bool(scenario.forces)
    with naming_holder():
        _check(holder, period, order)
        task = make_task(own, folder, station.progress) if before is None else before.task
        part = add_arm(named, chosen.nominal_model_source.holding(holder.workpiece))
        check_joints(own, task, part.robot.dimension)
        start = find_start(own.start, task, part) if before is None else before.initial_conditions
        senses = reacts and own.controller.external_torque.source == "measured"
        derivatives = cast(Derivatives, holder.derivatives)
        frame = WorkpieceFrame(order, derivatives, holder.highest, _placement(holder))
        options = dc.replace(
            chosen.follower,
            carries=True,
            stop_request=True,
            known_forces=("wrench_ext",) if reacts else (),
            extensions=[MeasuredReaction(), frame] if senses else [frame],
        )
        robot = add_controlled_robot(named, chosen, part, task, start, options, like=before)
    robot.scenario = _alone(own)
    signals = robot.signals
    drive = {"drive": signals["drive"], "joint_state": signals["joint_state"]}
    add_drives(named, part, None, DriverParameters(), period, drive, start[1])
    stops = [signals["stop_category"]]
    logged = add_friction(named, part, robot.true_state, chosen.friction, stops)
    logged |= {name: signals[name] for name in robot.controller.logged}
    logged |= robot.logged_states
    reaction = None
    if reacts:
        reaction, wrench = _add_reaction(named, part, robot.true_state, period)
        robot.controller.connect(builder, "wrench_ext", wrench)
        logged["wrench_ext"] = wrench
    return Holder(robot, holder, {f"{HOLDER}{n}": p for n, p in logged.items()}, reaction)


def _add_reaction(
    builder: DiagramBuilder, part: Arm, true_state: OutputPort, period: float
) -> tuple[BlockSystem, OutputPort]:
    """Apply the reaction of the process to the robot that holds the workpiece.

    Args:
        builder: Builder of the diagram.
        part: The robot, whose tool frame is the workpiece's.
        true_state: Its actual ``[q_J, v_J, q_M, v_M]``.
        period: Sampling time [s].

    Returns:
        The reaction, its inputs ``wrench`` and ``tool_pose`` of the other robot open; and the
        wrench on the workpiece at its frame's origin, world axes, shape (6,) [N, Nm].
    """
    view = builder.AddNamedSystem("workpiece_view", BlockSystem(ToolKinematics(part.robot), period))
    builder.Connect(true_state, view.GetInputPort("joint_state"))
    reaction = builder.AddNamedSystem("process_reaction", BlockSystem(Reaction(), period))
    builder.Connect(view.GetOutputPort("tool_pose"), reaction.GetInputPort("workpiece_pose"))
    # held over a sample, so that the same wrench acts on both robots
    hold = builder.AddNamedSystem("wrench_hold", BlockSystem(Hold(6), period))
    builder.Connect(reaction.GetOutputPort("reaction"), hold.GetInputPort("value"))
    wrench = hold.GetOutputPort("held")
    part.connect_wrench(builder, wrench, true_state)
    return reaction, wrench


@contextmanager
def naming_holder() -> Iterator[None]:
    """Name the block of the scenario in errors about the robot that holds the workpiece."""
    try:
        yield
    except InputError as error:
        message = str(error)
        raise InputError(
            message if message.startswith("holder.") else f"holder.{message}"
        ) from None


def _alone(own: Scenario) -> Scenario:
    """Return the scenario of a workpiece robot, for warnings: it has no force sensor itself."""
    torque = own.controller.external_torque
    if torque.source != "measured":
        return own
    known = dc.replace(own.controller, external_torque=dc.replace(torque, source="known"))
    return dc.replace(own, controller=known)


def _check(holder: HolderParameters, period: float, order: int) -> None:
    """Refuse a workpiece robot that does not suit the other robot."""
    model, own, law = holder.robot.model, holder.controller.sampling_time, holder.controller.law
    require(not is_delta(model), "robot.model", model, "a serial arm, which turns the workpiece")
    holder.workpiece.check()
    allowed = f"a law of relative degree {order} or more, as the other robot's is"
    require(RELATIVE_DEGREE[law] >= order, "controller.law", law, allowed)
    require(own == period, "controller.sampling_time", own, f"{period:g} s, the other robot's")


def _placement(holder: HolderParameters) -> np.ndarray:
    """Return the nominal pose of the base relative to the actual one, ``[p, R by rows]``, (12,)."""
    X_WB = holder.robot.base_pose.transform()
    shift = X_WB @ holder.placement_error.transform() @ X_WB.inverse()
    return np.concatenate([shift.translation(), shift.rotation().matrix().ravel()])
