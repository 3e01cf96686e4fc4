"""The signals of a run, from what its station logged."""

import numpy as np
from pydrake.systems.framework import Context
from scipy.spatial.transform import Rotation

from diagrams.station import Station
from experiments.results.drives import add_friction
from experiments.results.fastest import add_limits
from experiments.results.found_links import add_found_links
from experiments.results.guidance import add_guidance
from experiments.results.holder import add_holder_signals, seen_poses, workpiece_motion
from experiments.results.mounting import add_mounting_signals
from experiments.results.obstacles import add_obstacles
from experiments.results.path import add_pressing
from experiments.results.posture import add_link_signals, add_posture
from experiments.results.run_log import FloatArray, RunLog
from experiments.results.streaming import add_stream
from experiments.results.teleoperation import add_teleoperation
from pfsc_drake.control.compliance.impedance import DAMPING, STIFFNESS
from pfsc_drake.control.fixtures.robot_limits import limit_kinds
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.linearization import virtual_output_function
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import PlaceManifold, indices
from pfsc_drake.geometry import angle_between, matrix_to_zyx, matrix_to_zyz, turn_about
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.tool_load import joint_torque_function

# what stands in a station's log as in that of a run
_AS_LOGGED = (
    *("wrench_ext", "wrench_measured", "wrench_sensor", "wrench_observed"),
    *("tared", "sensor_fault", "tau_ext_observed"),
)


def collect_log(station: Station, root: Context) -> RunLog:
    """Return the signals of a run, named and with units as scripts expect them.

    Joint state, tool pose and path coordinates are the true ones, those of the links, also
    where the law acts on motor coordinates, on the errors from a moving reference point, or
    on what imperfect encoders measure. What it acted on is beside them: ``xi_M``,
    ``tracking_error``, ``q_J_measured``, ``y_t_measured``, ``xi_measured`` and so on.

    Args:
        station: The station that was simulated.
        root: Its context at the end.
    """
    return _named(station, *station.log.read(root))


def expected_signals(station: Station) -> set[str]:
    """Return the names of the signals that a station's run will have.

    Those that need a whole lap, or another event, may come beside them.

    Args:
        station: The station, simulated or not.
    """
    empty = {name: np.zeros((0, row.stop - row.start)) for name, row in station.log.rows.items()}
    return set(_named(station, np.zeros(0), empty).signals)


def _named(station: Station, times: FloatArray, raw: dict[str, FloatArray]) -> RunLog:
    """Return signals of what a station logged."""
    log = RunLog(times, turning=station.robot.gather("is_revolute").tolist())
    measured = raw.get("joint_state_measured")
    _add_joints(log, station, raw["joint_state"], raw["law"])
    if measured is not None:
        _add_joint_state(log, station, measured, "_measured")
    pose = _tool_poses(station, raw["joint_state"])
    frames = workpiece_motion(station, raw)
    if frames is not None:
        pose = seen_poses(pose, frames)
    log.add("y_t", pose[:, :3])
    log.add("R_e", pose[:, 3:])
    add_found_links(log, station, raw)
    # of what another robot holds, the controller has a belief
    deceived = measured is not None or not station.part.belief.sees_truth or frames is not None
    if deceived:
        log.add("y_t_measured", raw["tool_pose"][:, :3])
        log.add("R_e_measured", raw["tool_pose"][:, 3:])
    linearization, layout = station.law.linearization, station.law.layout
    Y = raw["law"][:, layout.manifold_state]
    Y = _by_order(Y, linearization.num_outputs).copy()
    points = raw["manifold_point"]
    if linearization.manifold.follows_time or station.on_motors or deceived:
        if linearization.manifold.follows_time:
            log.add("tracking_error", Y[:, 0, :3])
        else:
            _add_seen(log, station, Y[:, 0], "M" if station.on_motors else "measured")
        points = raw["true_place"] if "true_place" in raw else _project(station, pose)
        true_points = points if frames is None else np.hstack([points, frames])
        seen = _path_output(station, raw["joint_state"], true_points)
        # the orientation errors of trajectory tracking stay those from the moving reference
        rotational = indices(station.task.place.coordinates, Kind.ROTATIONAL)
        moving = linearization.manifold.follows_time and rotational.stop > 0
        replaced = slice(0, rotational.start) if moving else slice(None)
        Y[:, :2, replaced] = seen[:, : Y.shape[1], replaced]
    log.add("theta", points[:, station.task.place.layout.theta])
    log.add("alpha", points[:, station.task.place.layout.alpha])
    _add_manifold(log, station, raw, Y)
    add_orientation(log, station, raw["manifold_point"], points, pose)
    add_posture(log, station, raw)
    _add_forces(log, station, raw)
    add_pressing(log, station, raw, points)
    add_guidance(log, station, raw, pose[:, :3])
    add_mounting_signals(log, station, raw)
    add_holder_signals(log, station, raw)
    add_teleoperation(log, raw)
    add_obstacles(log, station, raw)
    add_link_signals(log, station, raw)
    add_stream(log, station, raw)
    _add_drives(log, station, raw)
    _add_plan(log, station)
    for name, length in station.further_lengths(pose[:, :3]).items():
        log.add(name, length.values, labels=length.labels, limits=length.limit)
    return log


def _add_seen(log: RunLog, station: Station, y: np.ndarray, suffix: str) -> None:
    """Add the coordinates that the law acted on, shape (samples, m)."""
    for kind, part, names in _kinds(station):
        if kind is Kind.ROTATIONAL and suffix == "M":
            continue
        labels = [name.replace(kind.value, f"{kind.value}_{suffix}", 1) for name in names]
        log.add(f"{kind.value}_{suffix}", y[:, part], labels=labels)


def _tool_poses(station: Station, joint_state: np.ndarray) -> np.ndarray:
    """Return ``[y_t, R_e]`` of the links, shape (samples, 12)."""
    q_J = joint_state[:, : station.robot.dimension]
    if len(q_J) == 0:
        return np.zeros((0, 12))
    return np.array(pose_function(station.robot).map(len(q_J))(q_J.T)).T


def _add_joints(log: RunLog, station: Station, state: np.ndarray, law: np.ndarray) -> None:
    chain = station.robot
    q_J, v_J, q_M, v_M = np.hsplit(state, 4)
    _add_joint_state(log, station, state)
    drive = law[:, station.law.layout.drive]
    if station.law.linearization.relative_degree > 1:
        log.add("tau_d", drive, limits=station.law.limits)
    elastic = chain.elastic_joints
    if elastic.any():
        K_s, K_d = chain.K_s[elastic], chain.K_d[elastic]
        tau_J = K_s * (q_M - q_J)[:, elastic] + K_d * (v_M - v_J)[:, elastic]
        log.add("tau_J", tau_J, labels=[f"tau_J_{i + 1}" for i in np.flatnonzero(elastic)])


def _add_plan(log: RunLog, station: Station) -> None:
    """Add how the reference was chosen for the drives, and what was expected of them."""
    plan, n = station.task.drive_plan, station.robot.dimension
    if plan is None or not (plan.is_slowed or plan.limiting):
        return
    if plan.limiting is None:
        log.add("pace", np.interp(log.time, plan.times, plan.pace))
    else:
        add_limits(log, plan)
    expected = [np.interp(log.time, plan.times, torque) for torque in plan.demand[:, :n].T]
    log.add("tau_planned", np.array(expected).T)


def _add_joint_state(log: RunLog, station: Station, state: np.ndarray, suffix: str = "") -> None:
    limits = {
        "q_J": station.robot.gather("position_limits"),
        "v_J": station.robot.gather("velocity_limit"),
    }
    names = ["q_J", "v_J"]
    if station.robot.elastic_joints.any():  # motors of rigid joints move as the links do
        names += ["q_M", "v_M"]
    for name, values in zip(names, np.hsplit(state, 4), strict=False):
        log.add(f"{name}{suffix}", values, limits=limits.get(f"{name}{suffix}"))


def _add_manifold(log: RunLog, station: Station, raw: dict[str, np.ndarray], Y: np.ndarray) -> None:
    law, layout, linearization = raw["law"], station.law.layout, station.law.linearization
    Y_p = _by_order(raw["reference"], linearization.num_outputs)
    for kind, part, labels in _kinds(station):
        name = kind.value
        log.add(name, Y[:, 0, part], labels=labels)
        if not station.law.stabilization.is_free[part].any():
            log.add(f"{name}_p", Y_p[:, 0, part], labels=[f"{x}_p" for x in labels])
        if linearization.relative_degree > 1:
            log.add(f"{name}_dot", Y[:, 1, part], labels=[f"{x}_dot" for x in labels])
    names = [f"v_{coordinate.name}" for coordinate in station.task.place.coordinates]
    unit = f"SI/s^{linearization.relative_degree}"
    log.add("virtual_input", law[:, layout.virtual_input], unit, names)
    status = law[:, layout.status]
    log.add("fault", status[:, 0].astype(int), labels=[fault.name.lower() for fault in Fault])
    requested = raw["stop_category"]
    if "servo_stop_category" in raw:
        requested = np.hstack([requested, raw["servo_stop_category"]])
    # the lowest category is the most urgent, and below 0 there is none
    urgent = np.where(requested < 0.0, np.inf, requested).min(axis=1)
    log.add("stop_category", np.where(np.isfinite(urgent), urgent, -1.0).astype(int))
    log.add("rcond", status[:, 1])
    log.add("saturated_drives", status[:, 2].astype(int))


def _by_order(values: FloatArray, outputs: int) -> FloatArray:
    """Return outputs and their derivatives, shape (samples, orders, outputs)."""
    return values.reshape(len(values), values.shape[1] // outputs, outputs)


def _kinds(station: Station) -> list[tuple[Kind, slice, list[str]]]:
    """Return the kinds of coordinates that there are, where they stand, and their names."""
    coordinates = station.task.place.coordinates
    parts = {kind: indices(coordinates, kind) for kind in Kind}
    names = {kind: [c.name for c in coordinates[part]] for kind, part in parts.items()}
    return [(kind, parts[kind], names[kind]) for kind in Kind if names[kind]]


def _project(station: Station, pose: np.ndarray) -> np.ndarray:
    """Project a motion of the tool on the manifold, sample by sample; shape (samples, size)."""
    task, memory = station.task, station.initial_place
    points = np.full((len(pose), task.place.layout.size), np.nan)
    for k, y_t in enumerate(pose[:, :3]):
        if np.isfinite(y_t).all():
            points[k] = task.evaluate(y_t, memory)
            memory = points[k, task.place.layout.memory]
    return points


def _path_output(station: Station, joint_state: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the virtual output of the links and its rate, shape (samples, 2, m)."""
    n, linearization = station.robot.dimension, station.law.linearization
    if len(points) == 0:
        return np.zeros((0, 2, linearization.num_outputs))
    carried = station.holder is not None or station.turntable is not None
    place = linearization.manifold if carried else station.task.place
    function = virtual_output_function(station.robot, place).map(len(points))
    Y = np.array(function(joint_state[:, :n].T, joint_state[:, n : 2 * n].T, points.T))
    return Y.T.reshape(len(points), 2, linearization.num_outputs)


def _add_forces(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Add what acts on the tool, what the sensor makes of it, and what the compliance asks for."""
    for name in _AS_LOGGED:
        if name in raw:
            log.add(name, raw[name])
    forces = [coordinate.force for coordinate in station.task.place.coordinates]
    if "manifold_force" in raw:
        log.add("manifold_force", raw["manifold_force"], labels=forces)
    if "damping" in raw:
        labels = [name.replace("tau", "d", 1) for name in forces]
        log.add("damping", raw["damping"], labels=labels)
    if "wrench_ext" in raw or "push_torque" in raw:
        log.add("tau_ext", _joint_torques(station, raw))
    if "desired_reference" in raw:
        desired = raw["desired_reference"][:, : station.law.linearization.num_outputs]
        for kind, part, names in _kinds(station):
            labels = [name.replace(kind.value, f"{kind.value}_d", 1) for name in names]
            log.add(f"{kind.value}_d", desired[:, part], labels=labels)
    if "impedance" in raw:
        _add_impedance(log, station, raw)
    if "limit_force" in raw:
        kinds = list(dict.fromkeys(limit_kinds(station.robot.dimension)))
        log.add("limit_force", raw["limit_force"], labels=kinds)


def _add_impedance(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Add what an operator has made of the impedance, where it is not as the scenario says."""
    names = [coordinate.name for coordinate in station.task.place.coordinates]
    impedance = _by_order(raw["impedance"], len(names))
    log.add("stiffness", impedance[:, STIFFNESS], labels=names)
    log.add("damping", impedance[:, DAMPING], labels=names)
    log.add("tank", raw["tank"])


def _joint_torques(station: Station, raw: dict[str, np.ndarray]) -> np.ndarray:
    """Return what acts on tool and links means in the joints, shape (samples, N)."""
    q_J = raw["joint_state"][:, : station.robot.dimension]
    pushes = raw.get("push_torque", np.zeros_like(q_J))
    if len(q_J) == 0 or "wrench_ext" not in raw:
        return pushes
    function = joint_torque_function(station.robot).map(len(q_J))
    return np.array(function(q_J.T, raw["wrench_ext"].T)).T + pushes


def _add_drives(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Add the torques that a velocity servo gives, and what friction takes."""
    if station.servo is not None:
        log.add("tau_d", raw["drive_torque"], limits=station.servo.limits)
        names = [fault.name.lower() for fault in Fault]
        log.add("servo_fault", raw["servo_fault"].astype(int), labels=names)
    add_friction(log, station, raw)


def add_orientation(
    log: RunLog, station: Station, followed: np.ndarray, place: np.ndarray, pose: np.ndarray
) -> None:
    """Add the ZYX angles of the tool and of the reference that the law compares it with.

    They are ZYZ angles where those are coordinates. And how far that reference is away from the
    orientation that belongs to the tool's place. Where only an axis of the tool matters, its
    directions take the place of the angles; where only its turn about an axis in space does, the
    turn since the reference that the run begins with.

    Args:
        log: To add to; nothing without an orientation to follow.
        station: The station that was simulated.
        followed: Points of the manifold that the law acted on, shape (samples, size).
        place: Points of the manifold next to the tool, shape (samples, size).
        pose: ``[y_t, R_e by rows]`` of the tool, shape (samples, 12).
    """
    linearization = station.law.linearization
    if not station.task.place.is_oriented:
        return
    point = followed if linearization.manifold.follows_time else place
    R_e, R_d = _rotations(station.task.place, pose, point)
    _, R_place = _rotations(station.task.place, pose, place)
    unknown = ~(np.isfinite(point).all(axis=1) & np.isfinite(pose).all(axis=1))
    tool = station.task.place.tool
    axis, yaw_axis = tool.tool_axis, tool.yaw_axis
    begin = R_d[int(np.argmin(unknown))] if len(R_d) else np.eye(3)
    for name, R in {"e": R_e, "d": R_d}.items():
        if yaw_axis is not None:
            turn = np.unwrap(turn_about(yaw_axis, R, begin))
            log.add(f"angles_{name}", np.where(unknown, np.nan, turn), labels=["the yaw axis"])
        elif axis is None:
            of_zyz = tool.euler == "zyz"
            angles = np.unwrap(matrix_to_zyz(R) if of_zyz else matrix_to_zyx(R), axis=0)
            angles[unknown] = np.nan
            log.add(f"angles_{name}", angles, labels=["z", "y", "z2" if of_zyz else "x"])
        else:
            directions = np.where(unknown[:, None], np.nan, R @ axis)
            log.add(f"axis_{name}", directions)
    lead = np.full(len(place), np.nan)
    if yaw_axis is not None:
        lead[~unknown] = np.abs(turn_about(yaw_axis, R_d, R_place))[~unknown]
    elif axis is not None:
        lead[~unknown] = angle_between(R_place @ axis, R_d @ axis)[~unknown]
    elif not unknown.all():
        between = np.swapaxes(R_place, 1, 2) @ R_d
        lead[~unknown] = Rotation.from_matrix(between[~unknown]).magnitude()
    log.add("orientation_lead", lead)


def _rotations(
    manifold: PlaceManifold, pose: np.ndarray, point: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tool's and the place's orientation, each (samples, 3, 3); I where not finite."""
    finite = np.isfinite(point).all(axis=1) & np.isfinite(pose).all(axis=1)
    R_e = np.where(finite[:, None], pose[:, 3:], np.eye(3).ravel()).reshape(-1, 3, 3)
    R_d = np.tile(np.eye(3), (len(point), 1, 1))
    if finite.any():
        R_d[finite] = manifold.orientation(point[finite])
    return R_e, R_d
