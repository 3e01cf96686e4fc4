"""Descriptions of faults: cause, location and joints, from the signals of the instant."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import ProjectedManifold, indices
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import euler_margin
from pfsc_drake.robot.coordinate_text import coordinate_text, enumeration, eta_text, posture_text
from pfsc_drake.robot.robot_model import RobotModel, largest_speeds
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.singular_posture import SingularPosture, singular_posture, singularity_name

_STATE = ("q_J", "v_J", "q_M", "v_M")
# m, from which on a distance from the path is reported where an arm becomes singular
_BESIDE = 1e-3
# of singular values of the Jacobian, from which on the posture is the cause of a fast joint
_NEARLY = 0.1


@dataclass(frozen=True)
class FaultReport:
    """Cause of a stop.

    Attributes:
        sentence: Cause and location.
        time: Begin of the fault [s].
    """

    sentence: str
    time: float


@dataclass(frozen=True)
class FaultInstant:
    """Signals of one instant.

    Attributes:
        time: Time [s].
        signals: By name, each of shape (size,).
    """

    time: float
    signals: dict[str, np.ndarray]

    @property
    def measured_state(self) -> np.ndarray:
        """``[q_J, v_J, q_M, v_M]`` as the input of the law, shape (4N,)."""
        return self.signals.get("joint_state_measured", self.signals["joint_state"])


@dataclass(frozen=True)
class FaultScene:
    """Robot, law and signals of a fault.

    Attributes:
        law: Law of the controller.
        robot: Nominal model of the robot.
        manifold: Manifold of the log's ``manifold_point``.
        on_motors: Whether the law acts on the tool pose of the motors.
        now: The first instant with the fault.
        before: The last instant without it, if there is any.
        suspects: Implausible components of the measured state, nonzero if so, shape (4N,); empty
            if unknown.
        oscillating: Drives whose commands oscillated before, by index.
    """

    law: FollowingLaw
    robot: RobotModel
    manifold: ProjectedManifold
    on_motors: bool
    now: FaultInstant
    before: FaultInstant | None
    suspects: np.ndarray = field(default_factory=lambda: np.zeros(0))
    oscillating: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))


def describe(fault: Fault, scene: FaultScene) -> str:
    """Return one sentence on a fault: cause, location on the path, time, and joints.

    Args:
        fault: The fault.
        scene: Robot, law and signals of the fault.
    """
    descriptions: dict[Fault, Callable[[FaultScene], str]] = {
        Fault.INPUT_NOT_FINITE: _not_finite,
        Fault.PROJECTION_FAILED: _projection_failed,
        Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD: _outside,
        Fault.SINGULAR: _singular,
        Fault.BEYOND_END: _beyond_end,
        Fault.MEASUREMENT_IMPLAUSIBLE: _implausible,
        Fault.JOINT_LIMIT: _joint_limit,
        Fault.JOINT_SPEED: _joint_speed,
        Fault.DRIVE_SATURATED: partial(_at_limit, Fault.DRIVE_SATURATED),
        Fault.DRIVE_CHATTERS: partial(_at_limit, Fault.DRIVE_CHATTERS),
        Fault.PRESS_FORCE_LOST: _press_lost,
        Fault.ORIENTATION_ERROR: _orientation_error,
    }
    if fault in descriptions:
        return descriptions[fault](scene)
    return f"{fault.explanation} {_location(scene)}"


def _not_finite(scene: FaultScene) -> str:
    """Return the names of the signals, causes first."""
    n, signals = scene.robot.dimension, scene.now.signals
    wrong = np.flatnonzero(~np.isfinite(scene.now.measured_state))
    names = _component_names(wrong, n)
    if names:
        return f"a measured value is not a finite number: {enumeration(names)} {_location(scene)}"
    known = {
        "wrench_measured": "measured force",
        "wrench_ext": "force on the tool",
        "reference": "reference",
    }
    found = [
        what
        for name, what in known.items()
        if name in signals and not np.isfinite(signals[name]).all()
    ]
    what = f": {found[0]}" if found else ""
    return f"{Fault.INPUT_NOT_FINITE.explanation}{what} {_location(scene)}"


def _component_names(components: np.ndarray, num_joints: int) -> list[str]:
    """Return the names of components of the joint state, ``q_J_1`` and so on."""
    return [f"{_STATE[i // num_joints]}_{i % num_joints + 1}" for i in components]


def _implausible(scene: FaultScene) -> str:
    names = _component_names(np.flatnonzero(scene.suspects), scene.robot.dimension)
    what = f": {enumeration(names)}" if names else ""
    sentence = f"{Fault.MEASUREMENT_IMPLAUSIBLE.explanation}{what} {_location(scene)}"
    if not len(scene.oscillating):
        return sentence
    axes = enumeration(map(str, scene.oscillating + 1))
    return (
        f"the loop oscillates: commands of {axes} oscillated, and {sentence}; an "
        "unstable loop does that with good sensors ('margins' shows whether it is stable), a "
        "faulty sensor can make it unstable"
    )


def _joint_limit(scene: FaultScene) -> str:
    robot = scene.robot
    q, limits = scene.now.measured_state[: robot.dimension], robot.gather("position_limits")
    beyond = np.maximum(limits[:, 0] - q, q - limits[:, 1])
    i = int(np.argmax(np.where(np.isfinite(beyond), beyond, -np.inf)))
    limit = limits[i, int(q[i] > limits[i].mean())]
    text = coordinate_text(float(limit), revolute=bool(robot.gather("is_revolute")[i]))
    return f"joint {i + 1} '{robot.names[i]}' is at its limit of {text} {_location(scene)}"


def _joint_speed(scene: FaultScene) -> str:
    robot, n = scene.robot, scene.robot.dimension
    v_J, v_M = (scene.now.measured_state[k * n : (k + 1) * n] for k in (1, 3))
    speed, limits = np.fmax(np.abs(v_J), np.abs(v_M)), largest_speeds(robot)
    i = int(np.nanargmax(speed / limits))
    revolute = bool(robot.gather("is_revolute")[i])
    found, limit = (coordinate_text(float(x[i]), revolute=revolute) for x in (speed, limits))
    q, posture = _posture(scene)
    nearly = posture.rcond < _NEARLY and i in posture.free_joints
    return (
        f"joint {i + 1} '{robot.names[i]}' moves at {found}/s of {limit}/s {_location(scene)}"
        + (
            f"; {describe_singularity(scene.robot, q, posture, 'nearly singular')}"
            if nearly
            else ""
        )
    )


def _at_limit(fault: Fault, scene: FaultScene) -> str:
    before = (scene.before or scene.now).signals
    if "drive_torque" in before and fault is Fault.DRIVE_CHATTERS:  # of velocity servos
        share = np.abs(before["drive_torque"]) / scene.robot.gather("effort_limit")
    else:
        share = np.abs(before["law"][scene.law.layout.drive]) / scene.law.limits
    # one that goes from limit to limit may be between them now
    axes = map(str, np.flatnonzero(share >= min(1.0, float(share.max())) * (1.0 - 1e-9)) + 1)
    return f"{fault.explanation}: {enumeration(axes)} {_location(scene)}"


def _press_lost(scene: FaultScene) -> str:
    signals = scene.now.signals
    across = indices(scene.law.linearization.manifold.coordinates, Kind.TRANSVERSAL)
    measured, desired = signals["manifold_force"][across.start], signals["press"].item()
    return (
        f"{Fault.PRESS_FORCE_LOST.explanation}: {measured:.3g} N measured, {desired:.3g} N desired "
        f"{_location(scene)}"
    )


def _orientation_error(scene: FaultScene) -> str:
    return f"{Fault.ORIENTATION_ERROR.explanation} {_location(scene)}: {_map_state(scene)}"


def _projection_failed(scene: FaultScene) -> str:
    y_t = (np.round(scene.now.signals["tool_pose"][:3], 4) + 0.0).tolist()
    return f"{Fault.PROJECTION_FAILED.explanation} {_location(scene)}: tool at {y_t} m"


def _outside(scene: FaultScene) -> str:
    alpha = scene.now.signals["manifold_point"][scene.manifold.layout.alpha].item()
    xi = ", ".join(
        f"{x:.1f}" for x in np.round(1e3 * _transversal_offset(scene), 1) + 0.0
    )  # no "-0.0"
    return (
        f"{Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD.explanation} {_location(scene)}: "
        f"xi = [{xi}] mm, alpha = {alpha:.3g}"
    )


def _beyond_end(scene: FaultScene) -> str:
    eta = scene.now.signals["manifold_point"][scene.manifold.layout.eta].item()
    first, last = scene.manifold.coordinates[0].ends
    end, beyond = ("start", first - eta) if eta < first else ("end", eta - last)
    return (
        f"{Fault.BEYOND_END.explanation} {_location(scene)}: {1e3 * beyond:.1f} mm beyond its {end}"
    )


def _singular(scene: FaultScene) -> str:
    q, posture = _posture(scene)
    A = _decoupling_matrix(scene)
    distance = float(np.linalg.norm(_transversal_offset(scene)))
    beside = f"; the tool is {1e3 * distance:.0f} mm beside the path" if distance > _BESIDE else ""
    if _is_map_singular(A, posture):
        bend = _bend(scene)
        return f"{Fault.SINGULAR.explanation} {_location(scene)}: {_map_state(scene)}{beside}{bend}"
    return describe_singularity(scene.robot, q, posture, f"singular {_location(scene)}") + beside


def _posture(scene: FaultScene) -> tuple[np.ndarray, SingularPosture]:
    """Return the joint coordinates on which the law acts, and their singular posture."""
    n, state = scene.robot.dimension, scene.now.measured_state
    q = state[2 * n : 3 * n] if scene.on_motors else state[:n]
    manifold, tool = scene.manifold, scene.manifold.tool
    posture = singular_posture(
        scene.robot,
        q,
        oriented=manifold.is_oriented,
        tool_axis=tool.tool_axis,
        yaw_axis=tool.yaw_axis,
    )
    return q, posture


def describe_singularity(
    robot: RobotModel, q: np.ndarray, posture: SingularPosture, how: str
) -> str:
    """Return which part of a robot is singular, its causing joints, and its free joints.

    Args:
        robot: The robot.
        q: Joint coordinates, shape (N,).
        posture: Distance to the singularity.
        how: Text after the name of the part: degree and location.
    """
    name = None
    if isinstance(robot, SerialChain):
        name = singularity_name(robot, q, posture)
    free = enumeration(f"q_{i + 1}" for i in posture.free_joints)
    return (
        f"{name or 'robot'} {how}: {posture_text(robot, q, posture.causing_joints)} "
        f"({free} can move without the tool)"
    )


def _bend(scene: FaultScene) -> str:
    """Return a text if the path bends too sharply for the tool's distance from it."""
    if not isinstance(scene.manifold, PathManifold):
        return ""
    point, layout = scene.now.signals["manifold_point"], scene.manifold.layout
    _, slope, second = point[layout.position][:9].reshape(3, 3)
    turning = float(np.linalg.norm(np.cross(slope, second)))
    radius = float(np.linalg.norm(slope)) ** 3 / turning if turning > 0.0 else np.inf
    if radius > np.linalg.norm(_transversal_offset(scene)):
        return ""
    return (
        f"; the path bends with a radius of {1e3 * radius:.3g} mm there, less than the "
        "distance of the tool: check the waypoints"
    )


def _decoupling_matrix(scene: FaultScene) -> np.ndarray:
    """Return ``A = d yhat / dq``, independent of drives and reference."""
    linearization, now = scene.law.linearization, scene.now
    arguments = {
        "state": now.measured_state,
        "tau_ext": 0.0,
        "manifold_point": now.signals["manifold_point"],
    }
    if linearization.manifold.follows_time:
        m = linearization.num_outputs
        arguments["progress"] = now.signals["reference"][::m]
    return np.array(linearization.function(**arguments)["A"])


def _is_map_singular(A: np.ndarray, posture: SingularPosture) -> bool:
    """Return whether the manifold's coordinates are singular rather than the arm's posture.

    ``A = T J`` with the map T from the tool's velocity to the coordinates' rates; the condition
    number of A is at most the product of the others.
    """
    scale = np.ones(len(A))
    scale[:3] = 1.0 / posture.length
    T = scale[:, None] * A @ np.linalg.pinv(scale[:, None] * posture.jacobian)
    s = np.linalg.svd(T, compute_uv=False)
    return bool(s[-1] / s[0] < posture.rcond)


def _map_state(scene: FaultScene) -> str:
    """Return the coordinates that may make a manifold's map singular."""
    linearization, signals = scene.law.linearization, scene.now.signals
    coordinates = linearization.manifold.coordinates
    Y = signals["law"][scene.law.layout.manifold_state][: len(coordinates)]
    rotational = indices(coordinates, Kind.ROTATIONAL)
    words = [
        f"{coordinates[i].name} = {np.rad2deg(Y[i]):.1f} deg"
        for i in range(rotational.start, rotational.stop)
    ]
    euler = linearization.manifold.tool.euler
    if euler is not None:
        margin = euler_margin(signals["tool_pose"][3:12].reshape(3, 3), euler)
        words.append(
            f"the tool's {euler} angles are {np.rad2deg(margin):.3g} deg from their singularity"
        )
    alpha = signals["manifold_point"][scene.manifold.layout.alpha].item()
    return ", ".join([*words, f"alpha = {alpha:.3g}"])


def _transversal_offset(scene: FaultScene) -> np.ndarray:
    """Return the transversal coordinates of the tool [m]."""
    point, layout = scene.now.signals["manifold_point"], scene.manifold.layout
    offset = scene.now.signals["tool_pose"][:3] - point[layout.position][:3]
    across = indices(scene.manifold.coordinates, Kind.TRANSVERSAL)
    return scene.manifold.axes(point).full()[:, across].T @ offset


def _location(scene: FaultScene) -> str:
    """Return ``at eta = 0.43 m, t = 0.93 s``, with the last known eta."""
    layout, known = scene.manifold.layout, None
    for instant in (scene.before, scene.now):
        if instant is not None:
            eta = instant.signals["manifold_point"][layout.eta]
            known = eta if np.isfinite(eta).all() else known
    where = "" if known is None else f"{eta_text(known)}, "
    return f"at {where}t = {scene.now.time:.3f} s"
