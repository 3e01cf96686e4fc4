"""Refusal of options that would have no effect on a controller."""

import dataclasses as dc
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pfsc_drake.compiled.content import content
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance
from pfsc_drake.control.law.laws import LAWS, RELATIVE_DEGREE
from pfsc_drake.control.law.robust_gains import rule_of_poles
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import GainParameters
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.options.motion_limits import MotionLimits
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.controller.tasks.stream_task import StreamTask
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel


@dataclass(frozen=True)
class Rule:
    """A condition under which an option has an effect.

    Attributes:
        key: Option, including all keys below it.
        is_used: Whether it has an effect.
        reason: Reason why it has none, for messages.
    """

    key: str
    is_used: bool
    reason: str


def refuse_unused(options: FollowerOptions, law: str, robot: RobotModel, task: Task) -> None:
    """Refuse options that differ from their default and would have no effect.

    Args:
        options: The options.
        law: Name of the law.
        robot: The robot, N joints.
        task: Task of the tool.

    Raises:
        InputError: If there is one; the message names it, and its requirement.
    """
    kinds = {coordinate.kind for coordinate in task.manifold.coordinates}
    is_redundant = robot.dimension > len(task.manifold.coordinates)
    used = [kind.value for kind in Kind if kind in kinds] + ["posture"] * is_redundant
    changed = dict(_changes(options, type(options)()))
    rules = [
        *_law_rules(options, law, task),
        *_state_rules(options, law, robot),
        *_posture_rules(options, is_redundant),
        *_friction_rules(options, law),
        *_compliance_rules(options.compliance, task, kinds),
        *_motion_rules(task),
        *_plan_rules(options, task),
        *_input_rules(options, task),
        *_fixture_rules(options, law, task),
        Rule(
            "bandwidth",
            _leaves_gains(options, law, used),
            "needs coordinates without gains of their own",
        ),
    ]
    for rule in rules:
        for key, value in changed.items():
            if not rule.is_used and f"{key}.".startswith(f"{rule.key}."):
                shown = value if isinstance(value, str | float | int | list) else "given"
                raise InputError(f"{key} = {shown}: has no effect; {rule.reason}")
    _refuse_unused_gains(options, law, used)
    if options.reference is not None:
        _refuse_unused_limits(options.reference)


def _changes(value: Any, default: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Iterate over keys and values that differ from a default, including nested blocks."""
    if dc.is_dataclass(value) and type(value) is type(default):
        for field in dc.fields(value):
            below = getattr(value, field.name), getattr(default, field.name)
            yield from _changes(*below, f"{key}.{field.name}" if key else field.name)
    elif content(value) != content(default):
        yield key, value


def _law_rules(options: FollowerOptions, law: str, task: Task) -> list[Rule]:
    chosen, servo = options.controller, RELATIVE_DEGREE[law] == 1
    torques = "needs a law that commands torques"
    return [
        Rule("controller.law", chosen.law == law, f"the law of the call is {law}"),
        Rule(
            "controller.manifold",
            chosen.manifold == task.manifold.name,
            f"the call follows a {task.manifold.name}",
        ),
        Rule("controller.model", False, "the plant of the call is the model"),
        Rule(
            "controller.boundary_layer_damping",
            LAWS[law].damps_springs,
            "needs the law singular_perturbation",
        ),
        Rule(
            "controller.external_torque.bandwidth",
            chosen.external_torque.source != "none",
            "needs a source of external torques",
        ),
        *(
            Rule(key, not servo, torques)
            for key in (
                "controller.brake_damping",
                "controller.effort_scale",
                "faults.hold_bandwidth",
                "faults.effort_share",
            )
        ),
        *(Rule(f"faults.brakes.{key}", False, "it is the plant's") for key in ("torque", "delay")),
        Rule(
            "controller.max_beyond_end",
            bool(np.isfinite([c.ends for c in task.manifold.coordinates]).any()),
            "needs a path with ends",
        ),
    ]


def _state_rules(options: FollowerOptions, law: str, robot: RobotModel) -> list[Rule]:
    finds = not robot.is_rigid and LAWS[law].knows_links
    elastic = "needs elastic joints, and a law that knows their links' side"
    bandwidth = finds and options.controller.state != "measured"
    return [
        Rule("controller.state", finds, elastic),
        Rule("controller.state_bandwidth", bandwidth, "needs a state that is not measured"),
        Rule("controller.state_uncertainty", False, "it is for standard deviations in runs"),
    ]


def _posture_rules(options: FollowerOptions, is_redundant: bool) -> list[Rule]:
    posture = options.controller.posture
    sprung = not posture.is_pulled and posture.stiffness > 0.0
    return [
        Rule("controller.posture", is_redundant, "needs more joints than the task has outputs"),
        Rule(
            "controller.posture.reference_deg",
            sprung,
            "needs a spring: task reference or elbow, and stiffness",
        ),
        Rule("controller.posture.elbow_joints", posture.task == "elbow", "needs task elbow"),
        Rule(
            "controller.posture.observer_rate",
            posture.yields == "observed",
            "needs yields = observed",
        ),
    ]


def _friction_rules(options: FollowerOptions, law: str) -> list[Rule]:
    friction, key = options.controller.friction, "controller.friction"
    observed = friction.source == "observer"
    kalman = observed and friction.observer == "kalman"
    overcome = friction.source != "none"
    holds = overcome and friction.hold_at_rest
    uses_friction = friction.has_coefficients or holds or options.obstacles is not None
    return [
        Rule(key, RELATIVE_DEGREE[law] > 1, "needs a law that commands torques"),
        Rule(
            "friction", uses_friction, "needs controller.friction with coefficients, or obstacles"
        ),
        Rule(f"{key}.velocity", friction.has_coefficients, "needs source model or observer kalman"),
        Rule(
            f"{key}.smoothing", friction.has_coefficients, "needs source model or observer kalman"
        ),
        Rule(f"{key}.observer", observed, "needs source observer"),
        Rule(
            f"{key}.hold_at_rest",
            overcome and options.friction is not None,
            "needs a source, and the option friction",
        ),
        Rule(f"{key}.rate", observed and not kalman, "needs observer disturbance"),
        Rule(f"{key}.kalman", kalman, "needs observer kalman"),
        Rule(
            f"{key}.kalman.resting_velocity",
            friction.kalman.intervals == "mean",
            "needs kalman.intervals mean",
        ),
        Rule(f"{key}.watched", False, "nothing is logged; see source observer"),
        Rule(f"{key}.nominal", False, "coefficients are the option friction"),
    ]


def _yields(impedance: CoordinateImpedance) -> bool:
    return bool(impedance.stiffness.at) or bool(np.isfinite(impedance.stiffness.value))


def _compliance_rules(compliance: ComplianceParameters, task: Task, kinds: set[Kind]) -> list[Rule]:
    def finite(kind: str) -> Rule:
        is_soft = _yields(getattr(compliance, kind))
        return Rule(f"compliance.{kind}", is_soft, "needs a finite stiffness of it")

    in_space, turns = isinstance(task, SpaceTask), Kind.ROTATIONAL in kinds
    along = _yields(compliance.tangential) and not in_space
    return [
        *(finite(kind) for kind in ("tangential", "transversal", "rotational")),
        Rule("compliance", compliance.is_given, "needs a coordinate of finite stiffness"),
        Rule("compliance.observed", compliance.source == "observed", "needs source observed"),
        Rule("compliance.rotational", turns, "needs a tool with an orientation"),
        Rule("compliance.transversal", not in_space, "needs a path or surface"),
        Rule("compliance.press", not in_space, "needs a surface"),
        Rule(
            "compliance.with_turning",
            along and turns and isinstance(task.manifold, PathManifold),
            "needs a finite tangential stiffness along a path with orientation",
        ),
        Rule(
            "compliance.limits",
            along,
            "needs a finite tangential stiffness along a path or surface",
        ),
        *_limit_rules("compliance.limits", compliance.limits.on),
    ]


def _limit_rules(key: str, is_on: bool) -> list[Rule]:
    keys = ("speed_share", "end_margin", "singular_floor", "settling")
    return [Rule(f"{key}.{name}", is_on, "needs on") for name in keys]


def _motion_rules(task: Task) -> list[Rule]:
    timed = "needs a path or surface with a motion over time"
    tracks = task.manifold.follows_time
    return [
        Rule(key, task.is_planned or isinstance(task, StreamTask), timed)
        for key in ("override", "stream")
    ] + [
        Rule("obstacles", not isinstance(task, StreamTask), timed),
        Rule("swings", not isinstance(task, SpaceTask) and not tracks, "needs a path or surface"),
        Rule("transition", not tracks, "the reference of a trajectory is a point that moves"),
    ]


def _plan_rules(options: FollowerOptions, task: Task) -> list[Rule]:
    motion = "needs a path or surface at rest with a motion over time, and no stream"
    planned = task.is_planned and options.stream is None and not options.swings
    rests = options.frame is None or options.frame_motion is not None
    moves = options.frame is not None and options.reference is not None
    return [
        Rule("reference", planned and rests, f"{motion}; or the planned motion of its frame"),
        Rule("frame_motion", moves, "needs frame and reference"),
    ]


def _input_rules(options: FollowerOptions, task: Task) -> list[Rule]:
    chosen, in_space = options.controller, isinstance(task, SpaceTask)
    known = chosen.external_torque.source == "known" or chosen.posture.yields == "known"
    return [
        Rule("operator", in_space or options.compliance.is_given, "needs a tool that complies"),
        Rule("operator.switches", in_space, "needs regions or guides"),
        Rule("known_forces", known, "needs forces that are known to law or posture"),
    ]


def _refuse_unused_limits(limits: MotionLimits) -> None:
    """Refuse limits without effect on a requested motion."""
    fastest = limits.speed == "fastest"
    unused = {"velocity": fastest, "dwell": fastest, "torque_rate": fastest, "acceleration": False}
    for key, is_used in unused.items():
        value = getattr(limits, key)
        if not is_used and value != getattr(MotionLimits(), key):
            reason = "the motion has its own" if key == "acceleration" else "needs speed fastest"
            raise InputError(f"reference.{key} = {value:g}: has no effect; {reason}")


def _fixture_rules(options: FollowerOptions, law: str, task: Task) -> list[Rule]:
    if not isinstance(task, SpaceTask):
        return []
    servo = RELATIVE_DEGREE[law] == 1
    return [
        Rule(
            "tells_law",
            not servo and options.controller.external_torque.source == "none",
            "needs a law that commands torques, and no source in controller.external_torque",
        ),
        *(Rule(key, servo, "needs the law velocity_servo") for key in ("servo_lag", "servo_delay")),
        Rule("fixtures.smoothing", not servo, "needs a law that commands torques"),
        *_limit_rules("fixtures.limits", task.options.limits.on),
    ]


def _leaves_gains(options: FollowerOptions, law: str, used: list[str]) -> bool:
    """Return whether a kind of coordinate has no gains of its own."""
    gains = options.controller.gains.get(law)
    if gains is None:
        return True
    kinds = [kind for kind in used if kind != "posture" or not gains.xi.is_given]
    return not all(getattr(gains, kind).is_given for kind in kinds)


def _refuse_unused_gains(options: FollowerOptions, law: str, used: list[str]) -> None:
    """Refuse gains of other laws or of no posture, and numbers beside given poles."""
    by_law = options.controller.gains
    if by_law and law not in by_law:
        raise InputError(
            f"controller.gains: given for {', '.join(by_law)}, have no effect; the law of the "
            f"call is {law}"
        )
    gains, degree = by_law.get(law), RELATIVE_DEGREE[law]
    if gains is None:
        return
    for field in dc.fields(gains):
        own: GainParameters = getattr(gains, field.name)
        key = f"controller.gains.{law}.{field.name}"
        if field.name == "posture" and "posture" not in used and own.is_given:
            raise InputError(f"{key}: given, has no effect; allowed: gains of {', '.join(used)}")
        slow = rule_of_poles(own.bandwidth, 1.0, degree)[:2]
        if own.bandwidth and own.poles and [*own.poles[:2]] != slow:
            raise InputError(
                f"{key}.bandwidth = {own.bandwidth:g}: has no effect beside poles; allowed: 0"
            )
        chosen = own.bandwidth > 0.0 and degree > 2
        if own.tolerated_error != GainParameters().tolerated_error and not chosen:
            raise InputError(
                f"{key}.tolerated_error = {own.tolerated_error:g}: has no effect; needs a "
                "bandwidth and a law of elastic joints"
            )
