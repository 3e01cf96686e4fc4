"""Options of a law: gains, poles, external forces, and the posture of redundant joints."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.checks import LARGEST_ANGLE, require, require_one_of
from pfsc_drake.control.estimation.link_deviation import StateUncertainty
from pfsc_drake.control.law.following_law import BEYOND_END_RANGE, MAX_BEYOND_END
from pfsc_drake.control.law.laws import LAWS, Law
from pfsc_drake.controller.options.friction_parameters import FrictionCompensationParameters
from pfsc_drake.yaml.fields import AUTO_OR_MANY, NAME_OR_FILE, ONE_FOR_ALL, former
from pfsc_drake.yaml.rules import (
    NotNegative,
    Numbers,
    OneOf,
    Parameters,
    Positive,
    Positives,
    Range,
)

POSTURE_TASKS = ("reference", "limits", "conditioning", "elbow")
_WEIGHTS = ("identity", "inertia", "range")
_YIELD_SOURCES = ("none", "known", "observed")
_ELBOW_JOINTS = (2, 4, 6)


@dc.dataclass
class PostureParameters(Parameters):
    """Posture of a robot with more joints than the task has outputs.

    The joints follow a posture reference in the null space of the outputs, with the poles of
    ``controller.gains.<law>.posture``, by default those of ``xi``. The reference starts at the
    initial joint coordinates, and moves like a mass with damper and spring behind a filter that
    makes it smooth enough for the law.

    Attributes:
        task: ``reference``: towards ``reference_deg``; ``limits``: away from the joints' limits;
            ``conditioning``: towards well-conditioned postures; ``elbow``: as ``reference``, with
            the elbow's swivel angle exactly equal to its reference.
        reference_deg: Goal of the posture, one number per joint or one for all [deg], m for slides;
            empty for its start.
        weight: Weight of deviations of the joints: ``identity``; ``inertia`` of the robot;
            ``range``, relative to the ranges of the joints.
        joint_weights: Weights, one positive number per joint, or one for all; empty for
            ``weight``.
        elbow_joints: Numbers of the joints whose origins are shoulder, elbow and wrist, the first
            joint being 1.
        inertia: Inertia of the posture in the null space, every joint [kg m^2 or kg].
        damping: Damping of the posture [Nm s/rad or N s/m].
        stiffness: Stiffness of its spring [Nm/rad or N/m], or of the pull of ``limits`` and
            ``conditioning``; 0 for none.
        filter_rate: Rate of the filter [rad/s].
        yields: External torques with which it complies: ``none``; ``known``: of all forces on the
            robot; ``observed``: observed from the motion of the links, without a sensor.
        observer_rate: Rate of the observer of torques [rad/s].
    """

    task: Annotated[str, OneOf(POSTURE_TASKS)] = "reference"
    reference_deg: Annotated[
        list[float], Numbers(each=Range(-LARGEST_ANGLE, LARGEST_ANGLE, "deg"))
    ] = dc.field(default_factory=list, metadata=ONE_FOR_ALL)
    weight: Annotated[str, OneOf(_WEIGHTS)] = "identity"
    joint_weights: Positives = dc.field(default_factory=list, metadata=ONE_FOR_ALL)
    elbow_joints: list[int] = dc.field(default_factory=lambda: list(_ELBOW_JOINTS))
    inertia: Positive = 1.0
    damping: Positive = 20.0
    stiffness: NotNegative = 50.0
    filter_rate: Positive = 30.0
    yields: Annotated[str, OneOf(_YIELD_SOURCES)] = "none"
    observer_rate: Positive = 60.0

    def __post_init__(self) -> None:
        super().__post_init__()
        alone = not self.joint_weights or self.weight == "identity"
        require(alone, "joint_weights", self.joint_weights, "empty where weight is given")
        joints = self.elbow_joints
        good = len(joints) == 3 and 0 < joints[0] < joints[1] < joints[2]
        require(good, "elbow_joints", joints, "3 numbers of joints in ascending order")

    @property
    def is_pulled(self) -> bool:
        """Whether a potential moves the posture, not a spring."""
        return self.task in ("limits", "conditioning")


MANIFOLDS = ("path", "trajectory", "surface", "space")
_SLOWEST, _FASTEST = 1e-2, 1e5  # rad/s, of an estimate
_TORQUE_SOURCES = ("none", "known", "measured", "observed")


@dc.dataclass
class GainParameters(Parameters):
    """Gains of one kind of coordinate, by poles or by the dissertation's coefficients.

    Attributes:
        poles: Real poles [1/s], r of them, or one number for r equal ones; ``auto`` chooses
            them for a bandwidth: two slow ones for the convergence, faster ones for the
            robustness. A run's resolved scenario lists the chosen poles.
        bandwidth: Magnitude of the slow poles [1/s] with ``auto``.
        tolerated_error: Relative error of masses and joint stiffnesses that poles by ``auto``
            tolerate.
        free: Whether only its velocity is controlled, for hand guiding; then there are r - 1
            poles, or the coefficients ``a_2 .. a_r``. For ``eta`` and ``phi``.
        coefficients: ``a_1 .. a_r``, alternatively.
        integral: ``a_0``; needs coefficients.
        integral_pole: With poles, one more pole [1/s] and with it an integral part, which removes
            the steady-state error of wrong masses; 0 for none.
    """

    poles: list[float] = dc.field(default_factory=list, metadata=AUTO_OR_MANY)
    coefficients: list[float] = dc.field(default_factory=list)
    integral: float = 0.0
    integral_pole: Annotated[float, Range(most=0.0, words="zero or a negative number")] = 0.0
    bandwidth: NotNegative = 0.0
    tolerated_error: Annotated[float, Range(0.0, 0.5, words="a fraction from 0 to 0.5")] = dc.field(
        default=0.05, metadata=former("bears")
    )
    free: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        alone = self.integral_pole != 0.0 and bool(self.coefficients)
        require(not alone, "integral_pole", self.integral_pole, "0 with coefficients; see integral")
        fixes_position = self.bandwidth or self.integral or self.integral_pole
        require(
            not (self.free and fixes_position),
            "free",
            self.free,
            "false with bandwidth, integral or integral_pole, which hold a position",
        )
        require(
            not (self.bandwidth and self.coefficients),
            "bandwidth",
            self.bandwidth,
            "with poles: auto only, not with coefficients",
        )
        require(
            not (self.poles and (self.coefficients or self.integral)),
            "poles",
            self.poles,
            "either poles, or coefficients with or without integral",
        )

    @property
    def is_given(self) -> bool:
        """Whether there are any gains."""
        return bool(self.poles or self.coefficients or self.bandwidth)

    @property
    def is_automatic(self) -> bool:
        """Whether poles are chosen automatically."""
        return self.bandwidth > 0.0 and not self.poles


@dc.dataclass
class LawGains:
    """Gains of all coordinates for one law.

    Attributes:
        eta: Tangential.
        xi: Both transversal.
        phi: Rotational; unused without orientation.
        posture: Joints about the posture reference of a redundant robot; by default the gains of
            ``xi`` without their integral part.
    """

    eta: GainParameters = dc.field(default_factory=GainParameters)
    xi: GainParameters = dc.field(default_factory=GainParameters)
    phi: GainParameters = dc.field(default_factory=GainParameters)
    posture: GainParameters = dc.field(default_factory=GainParameters)

    @property
    def is_automatic(self) -> bool:
        """Whether any poles are chosen automatically."""
        return any(gains.is_automatic for gains in (self.eta, self.xi, self.phi, self.posture))

    def __post_init__(self) -> None:
        integral = self.posture.integral or self.posture.integral_pole
        require(integral == 0.0, "posture", integral, "gains without an integral part")
        for key in ("xi", "posture"):
            free = getattr(self, key).free
            require(not free, f"{key}.free", free, "false; eta and phi may be free")


@dc.dataclass
class ExternalTorqueParameters(Parameters):
    """External torques in the joints, as an input of the law.

    Attributes:
        source: ``none``: nothing; ``known``: from the wrench that acts on the tool;
            ``measured``: from the force/torque sensor; ``observed``: from the motion of the links,
            without a sensor.
        bandwidth: Bandwidth of the estimated derivatives, of which laws for elastic joints need one
            or two, and of the torque itself [rad/s]; 0 for the unfiltered torque without
            derivatives, except with an observer.
    """

    source: Annotated[str, OneOf(_TORQUE_SOURCES)] = "none"
    bandwidth: Annotated[float, Range(_SLOWEST, _FASTEST, "rad/s", besides=0.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        possible = self.source != "observed" or self.bandwidth > 0.0
        require(possible, "bandwidth", self.bandwidth, "a positive number with source observed")


STATES = ("measured", "from_torque", "observed")


@dc.dataclass
class ControllerParameters(Parameters):
    """Parameters of the path following controller.

    Attributes:
        law: Actuation model of the law.
        gains: Gains by law.
        sampling_time: Sampling time ``T_s`` [s].
        boundary_layer_damping: Diagonal of ``epsilon D_b``, or one number for all joints [s], for
            ``singular_perturbation``.
        min_rcond: Smallest reciprocal condition number of the decoupling matrix.
        damped_below: Reciprocal condition number below which the joints' motion is damped, so
            that a robot moves through singular postures beside its path instead of stopping; 0
            for never, else above ``min_rcond``.
        max_alpha: End of the feasible neighbourhood for the controller, below 1.
        max_beyond_end: Largest distance of the tool beyond an end of an open path [m]; a fault
            farther out.
        brake_damping: Damping of the safe state on every drive, as a fraction of its
            effort limit per rad/s.
        effort_scale: Fraction of the model's effort limits that the law may use.
        manifold: ``path``: path following; ``trajectory``: classical trajectory
            tracking along the path, for comparison; ``surface``: surface following; ``space``:
            hand guiding within fixtures.
        external_torque: External torques as an input of the law.
        model: Nominal model of the robot, as ``robot.model``, or a YAML file with robot parameters;
            empty for the model of the plant. ``model_error`` is added.
        friction: Compensation of friction.
        posture: Posture of redundant joints.
        state: Source of the links' side of elastic joints: ``measured``; ``from_torque``, by torque
            sensors in the joints; ``observed``, by the motors alone.
        state_bandwidth: Bandwidth of the observed motion and torques of the links [rad/s].
        state_uncertainty: Uncertainty of its parameters, for a run's standard deviations.
        delay: Delay of the commanded torques [s], a multiple of the sampling time, at most 10 of
            it: the law then acts on the state that its model predicts for that time, with
            velocities of the age of positions. Null for a law without prediction.
        torque_lead: With the law ``rigid``: whether torques are extrapolated from the last two
            samples to the middle of their hold interval, as with the elastic laws.
    """

    law: Annotated[str, OneOf(LAWS)] = "elastic"
    gains: dict[str, LawGains] = dc.field(default_factory=dict)
    sampling_time: Annotated[float, Range(1e-05, 0.1, "s, a positive number")] = 1e-3
    boundary_layer_damping: list[float] = dc.field(default_factory=list, metadata=ONE_FOR_ALL)
    min_rcond: float = 1e-3
    damped_below: float = 0.0
    max_alpha: float = 0.95
    max_beyond_end: Annotated[float, Range(*BEYOND_END_RANGE, "m")] = MAX_BEYOND_END
    brake_damping: NotNegative = 0.1
    effort_scale: Positive = 1.0
    manifold: Annotated[str, OneOf(MANIFOLDS)] = "path"
    external_torque: ExternalTorqueParameters = dc.field(default_factory=ExternalTorqueParameters)
    model: str = dc.field(default="", metadata=NAME_OR_FILE)
    friction: FrictionCompensationParameters = dc.field(
        default_factory=FrictionCompensationParameters
    )
    posture: PostureParameters = dc.field(default_factory=PostureParameters)
    state: Annotated[str, OneOf(STATES)] = "measured"
    state_bandwidth: Positive = 800.0
    state_uncertainty: StateUncertainty = dc.field(default_factory=StateUncertainty)
    delay: NotNegative | None = None
    torque_lead: bool = False

    @property
    def law_record(self) -> Law:
        """Properties of the chosen law."""
        return LAWS[self.law]

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed = (
            "false except with the law 'rigid'; the elastic laws always extrapolate their torques"
        )
        require(self.law_record.can_lead or not self.torque_lead, "torque_lead", True, allowed)
        for law in self.gains:
            require_one_of(f"gains.{law}", law, LAWS)
        good = self.damped_below == 0.0 or self.min_rcond < self.damped_below < 1.0
        allowed = f"0, or above min_rcond = {self.min_rcond:g} and below 1"
        require(good, "damped_below", self.damped_below, allowed)
