"""Options of a whole controller, of its faults, and of regions that a led tool stays out of."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np

from pfsc_drake.control.compliance.tuned_impedance import REQUESTS, TuningParameters
from pfsc_drake.control.fixtures.fixture_parameters import GuidanceParameters, RobotLimitParameters
from pfsc_drake.control.law.swing import Swing
from pfsc_drake.control.law.timed_reference import StreamLimits
from pfsc_drake.control.obstacles.elbow_room import ElbowParameters
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.controller.extension import Extension
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.motion_limits import MotionLimits
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.yaml.fields import ONE_OR_MANY
from pfsc_drake.yaml.rules import Count, NotNegative, NotNegatives, Parameters, Positive, Range


@dc.dataclass
class BrakeParameters(Parameters):
    """Holding brakes on the motors, which close at stop category 0.

    Attributes:
        torque: Holding torque [Nm, joint side; or N], one for all or of every joint; empty for
            the drive's limit.
        delay: From the request until they hold [s].
    """

    torque: NotNegatives = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    delay: NotNegative = 0.1


@dc.dataclass
class FaultParameters(Parameters):
    """What is a fault beside what every law takes for one, and what happens then.

    Attributes:
        plausibility: By how much positions and integrated velocities of a joint may differ until
            they are not believed [rad or m], see
            :class:`~pfsc_drake.control.law.supervision.Supervision`; 0 to believe everything.
        joint_limits: Whether a joint at its limit is a fault.
        overspeed: Share of its largest speed by which a joint may be faster until it is a fault;
            ``.inf`` if no speed is.
        saturation_time: How long a drive may be at its limit [s], half of the time that it is not
            being taken off; 0 for ever, null for 0.2 s where the law commands torques, and for
            ever where it commands velocities.
        chatter_turns: How many times a drive may turn from one limit to the other, fewer being
            forgotten with 0.2 s; 0 for any number.
        hold_bandwidth: Hold bandwidth of the position hold after a fault [rad/s].
        effort_share: Part of the drives' limits that braking is planned with, up to 1.
        brakes: Holding brakes, which are requested after a stop, and earlier where nothing is
            measured of a joint (``stop_category``); ``null`` for a robot without, whose drives
            hold it.
    """

    plausibility: NotNegative = 2e-3
    joint_limits: bool = True
    overspeed: Annotated[float, Range(0.0, infinite=True)] = 0.1
    saturation_time: NotNegative | None = None
    chatter_turns: NotNegative = 6.0
    hold_bandwidth: Positive = 60.0
    effort_share: Annotated[float, Range(0.0, 1.0, open=True)] = 0.7
    brakes: BrakeParameters | None = dc.field(default_factory=BrakeParameters)


# at a sample, so that a region that comes near is found beside those that are
_FEWEST_LOOKS = 2


@dc.dataclass
class FixtureOptions(Parameters):
    """What limits a tool that is led through space.

    Attributes:
        guidance: How it is kept out of regions.
        limits: How far it follows a hand to where the robot itself cannot go on.
        smoothing: Time constant [s] of each of the r - 1 lags that make the reference smooth
            enough for laws that give torques.
        looks: Most distances that are computed at a tick beside those of regions that are near;
            0 for as many as are due, else 2 or more.
    """

    guidance: GuidanceParameters = dc.field(default_factory=GuidanceParameters)
    limits: RobotLimitParameters = dc.field(default_factory=RobotLimitParameters)
    smoothing: Annotated[float, Range(0.001, 0.1, "s")] = 0.003
    looks: Annotated[
        int, Range(_FEWEST_LOOKS, besides=0, words=f"0, or {_FEWEST_LOOKS} and more")
    ] = 0


@dc.dataclass
class ObstacleOptions(Parameters):
    """Obstacles that progress along a path waits for.

    Attributes:
        shapes: What they look like.
        watch: How progress waits for them.
        elbow: How the elbow of an arm with joints to spare avoids them; it does not if omitted.
    """

    shapes: Annotated[list[ObstacleShape], Count(1)]
    watch: WatchParameters = dc.field(default_factory=WatchParameters)
    elbow: ElbowParameters | None = None


@dc.dataclass
class OperatorOptions:
    """Settings of an operator that change while the robot moves, by ports of their own.

    Attributes:
        tuning: Response of the impedance to settings, input ``impedance_request``, see
            :class:`~pfsc_drake.control.compliance.tuned_impedance.ImpedanceTuner`.
        switches: Number of regions and guides that are switched on and off one by one, input
            ``regions_on``; 0 for none.
    """

    tuning: TuningParameters = dc.field(default_factory=TuningParameters)
    switches: int = 0

    @property
    def requests(self) -> dict[str, int]:
        """Sizes of the inputs, by name."""
        switches = {"regions_on": self.switches} if self.switches else {}
        return {"impedance_request": REQUESTS} | switches


# 1/s, of poles that nobody chooses
BANDWIDTH = 20.0


@dc.dataclass
class FollowerOptions:
    """What can be chosen of a path or surface following controller.

    Attributes:
        bandwidth: Bandwidth of the error dynamics [1/s], for coordinates without gains of their
            own; their poles are chosen by it, see :class:`GainParameters`.
        controller: Gains, limits, friction, forces, posture, sampling time. Its law is the one
            that the controller is added with.
        faults: What is a fault.
        friction: Coefficients f_c and f_v of the drives that are believed, each (N,).
        posture: From where the posture at the start is looked for, shape (N,) [rad or m]; the
            middle of the joints' limits if omitted.
        transition: How long the reference takes from where the tool is at the start to the motion
            that is wanted [s]; 0 for no such transition.
        compliance: How the tool yields to a hand or to what it touches; by default not at all.
        override: Whether there is a port for the pace of the motion, see :class:`TimedReference`.
        stream: How fast the tool goes along a path to way points that come while it moves, by a
            port of their own, in place of a motion over time; None for the latter.
        obstacles: What progress along a path waits for: there is a port for where it is, and with
            ``override`` the pace that is asked for is from 0 to 1. None for nothing.
        measures: What is measured: ``plant_state``, the state ``[q, v]`` of the plant, or
            ``joint_state``, ``[q_J, v_J, q_M, v_M]``.
        frame: Of a path or surface that moves: the pose of its frame at the start, ``[p_WC, R_WC
            by rows]``, shape (12,) [m, 1]; there is a port for the motion then. None if it rests.
        swings: Oscillations of the manifold along its normals (5.1), (5.2).
        reference: What the motion may take of the drives: where it takes more it is slowed, or
            there is a warning; or it is made as fast as they allow. None to leave it as it is.
        operator: Settings of an operator, by ports of their own; none if omitted.
        stop_request: Whether there is a port that stops the robot at any value but 0.
        carries: Whether there is a port for the motion of the joints, ``joint_jet``, of a robot
            that carries a workpiece.
        known_forces: Names of the inputs with forces that are known, of ``wrench_ext`` (on the
            tool point, world axes, shape (6,) [N, Nm]) and ``push_torque`` (of forces on links,
            shape (N,) [Nm or N]); None to take the port ``wrench`` for known as for measured ones.
        frame_motion: Returns the planned motion of the frame that carries the manifold, ``[p_WC,
            R_WC by rows]`` over time, with which the demand on the drives is planned.
        extensions: Further blocks, such as the compensation of a tool behind a force sensor.
    """

    bandwidth: float = BANDWIDTH
    controller: ControllerParameters = dc.field(default_factory=ControllerParameters)
    faults: FaultParameters = dc.field(default_factory=FaultParameters)
    friction: tuple[np.ndarray, np.ndarray] | None = None
    posture: np.ndarray | None = None
    transition: float = 0.0
    compliance: ComplianceParameters = dc.field(default_factory=ComplianceParameters)
    override: bool = False
    stream: StreamLimits | None = None
    obstacles: ObstacleOptions | None = None
    measures: str = "plant_state"
    frame: np.ndarray | None = None
    swings: list[Swing] = dc.field(default_factory=list)
    reference: MotionLimits | None = None
    operator: OperatorOptions | None = None
    stop_request: bool = False
    carries: bool = False
    known_forces: tuple[str, ...] | None = None
    frame_motion: Callable[[], PiecewisePolynomialCurve] | None = None
    extensions: Sequence[Extension] = ()
