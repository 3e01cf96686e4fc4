"""Options of a complete controller, its faults, and virtual fixtures of hand guiding."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np

from pfsc_drake.control.compliance.tuned_impedance import REQUESTS, TuningParameters
from pfsc_drake.control.fixtures.fixture_parameters import GuidanceParameters, RobotLimitParameters
from pfsc_drake.control.law.swing import Swing
from pfsc_drake.control.law.timed_reference import StreamLimits
from pfsc_drake.control.obstacles.elbow_clearance import ElbowParameters
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.controller.extension import Extension
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.motion_limits import MotionLimits
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.yaml.fields import ONE_OR_MANY, former
from pfsc_drake.yaml.rules import Count, NotNegative, NotNegatives, Parameters, Positive, Range


@dc.dataclass
class BrakeParameters(Parameters):
    """Holding brakes on the motors, which close at stop category 0.

    Attributes:
        torque: Holding torque [Nm, joint side; or N], one for all or of every joint; empty for
            the drive's limit.
        delay: Time from the request until they hold [s].
    """

    torque: NotNegatives = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    delay: NotNegative = 0.1


@dc.dataclass
class FaultParameters(Parameters):
    """Faults beyond those of every law, and the response to them.

    Attributes:
        plausibility: Largest plausible difference of position and integrated velocity of a joint
            [rad or m], see :class:`~pfsc_drake.control.law.supervision.Supervision`; 0 for no
            check.
        joint_limits: Whether a joint at its limit is a fault.
        overspeed: Tolerated excess of a joint's largest speed, as a share of it; ``.inf`` for no
            limit.
        saturation_time: Longest time of a drive at its limit [s], minus half of the time that it is
            not; 0 for no limit, null for 0.2 s if the law commands torques, and for no limit if it
            commands velocities.
        chatter_turns: Largest number of changes of a drive from one limit to the other, forgotten
            with a time constant of 0.2 s; 0 for any number.
        hold_bandwidth: Bandwidth of the position hold after a fault [rad/s].
        effort_share: Share of the drives' limits for planned braking, up to 1.
        brakes: Holding brakes, requested after a stop, and earlier without any measurement of a
            joint (``stop_category``); ``null`` for a robot without brakes, held by its drives.
    """

    plausibility: NotNegative = 2e-3
    joint_limits: bool = True
    overspeed: Annotated[float, Range(0.0, infinite=True)] = 0.1
    saturation_time: NotNegative | None = None
    chatter_turns: NotNegative = 6.0
    hold_bandwidth: Positive = 60.0
    effort_share: Annotated[float, Range(0.0, 1.0, open=True)] = 0.7
    brakes: BrakeParameters | None = dc.field(default_factory=BrakeParameters)


# at a sample, so that an approaching region is found beside the near ones
_FEWEST_EVALUATIONS = 2


@dc.dataclass
class FixtureOptions(Parameters):
    """Limits of hand guiding through space.

    Attributes:
        guidance: Parameters of the forbidden regions.
        limits: Limits of the robot.
        smoothing: Time constant [s] of each of the r - 1 lags that make the reference smooth
            enough for laws that command torques.
        distance_evaluations: Largest number of distance evaluations in a sample beside those of
            near regions; 0 for all that are due, else 2 or more.
    """

    guidance: GuidanceParameters = dc.field(default_factory=GuidanceParameters)
    limits: RobotLimitParameters = dc.field(default_factory=RobotLimitParameters)
    smoothing: Annotated[float, Range(0.001, 0.1, "s")] = 0.003
    distance_evaluations: Annotated[
        int, Range(_FEWEST_EVALUATIONS, besides=0, words=f"0, or {_FEWEST_EVALUATIONS} and more")
    ] = dc.field(default=0, metadata=former("looks"))


@dc.dataclass
class ObstacleOptions(Parameters):
    """Obstacles for which the motion along a path waits.

    Attributes:
        shapes: Shapes of the obstacles.
        watch: Parameters of the waiting motion.
        elbow: Avoidance by the elbow of a redundant arm; none if omitted.
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


# 1/s, default of poles
BANDWIDTH = 20.0


@dc.dataclass
class FollowerOptions:
    """Options of a path or surface following controller.

    Attributes:
        bandwidth: Bandwidth of the error dynamics [1/s], for coordinates without gains of their
            own, see :class:`GainParameters`.
        controller: Gains, limits, friction, forces, posture, sampling time. Its law is the law
            of the call.
        faults: Parameters of faults.
        friction: Nominal coefficients f_c and f_v of the drives, each (N,).
        posture: Initial guess of the posture at the start, shape (N,) [rad or m]; the middle of the
            joints' limits if omitted.
        transition: Duration of the transition of the reference from the start of the tool to the
            desired motion [s]; 0 for none.
        compliance: Compliance of the tool with an operator or the environment; rigid by default.
        override: Whether there is a port for the speed scaling of the motion, see
            :class:`TimedReference`.
        stream: Limits of the motion along a path to received waypoints, with a port of their own,
            in place of a motion over time; None for the latter.
        obstacles: Obstacles for which the motion waits, with a port for their positions; with
            ``override`` the requested speed scaling is from 0 to 1. None for no obstacles.
        measures: Measured signals: ``plant_state``, the state ``[q, v]`` of the plant, or
            ``joint_state``, ``[q_J, v_J, q_M, v_M]``.
        frame: Pose of the frame of a moving path or surface at the start, ``[p_WC, R_WC by rows]``,
            shape (12,) [m, 1]; there is a port for its motion then. None if it rests.
        swings: Oscillations of the manifold along its normals (5.1), (5.2).
        reference: Limits of the motion by the drives: beyond them it is slowed, or there is a
            warning; or it is planned as fast as they allow. None for an unlimited motion.
        operator: Settings of an operator, by ports of their own; none if omitted.
        stop_request: Whether there is a port that stops the robot at any value except 0.
        carries: Whether there is a port for the joint motion, ``joint_jet``, of a workpiece robot.
        known_forces: Names of the inputs with known forces: ``wrench_ext`` (on the
            tool point, world axes, shape (6,) [N, Nm]) and ``push_torque`` (of forces on links,
            shape (N,) [Nm or N]); None to use the port ``wrench`` for known and measured forces.
        frame_motion: Returns the planned motion of the manifold's frame, ``[p_WC, R_WC by rows]``
            over time, for the plan of the demand on the drives.
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
