"""Workpiece that moves: the robot or turntable that carries it, and the tool on it."""

import numpy as np

from diagrams.holder_station import HOLDER
from diagrams.station import Station
from diagrams.turntable_station import TURNTABLE
from experiments.results.feature import Feature, Raw
from experiments.results.joints_feature import axis_labels
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.manifolds.frame_motion import flange_motion_function
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, frame_size
from pfsc_drake.geometry import angle_between
from pfsc_drake.geometry.rotation import placed_points
from reporting import style
from reporting.metrics import Metrics

_SMOOTHED = 5  # samples, of speeds that are differences of true positions


def workpiece_motion(station: Station, raw: Raw) -> FloatArray | None:
    """Return the true motion of the workpiece, up to its velocity.

    Args:
        station: The station that was simulated.
        raw: What it logged.

    Returns:
        Derivatives 0..r of ``[p_WC, R_WC by rows]``, those from the second on zero, shape
        (samples, 12 (r + 1)); None of a station where nothing carries one.
    """
    holder, turntable = station.holder, station.turntable
    order = station.task.manifold.layout.order
    if turntable is not None:
        angles = raw[f"{TURNTABLE}motion"]
        motion = np.zeros((len(angles), frame_size(order)))
        if len(angles):
            mapped = turntable.motion.map(len(angles))
            motion[:, : 2 * POSE_SIZE] = np.array(mapped(angles.T)).T
        return motion
    if holder is None:
        return None
    state = raw[f"{HOLDER}joint_state"]
    motion = np.zeros((len(state), frame_size(order)))
    if len(state):
        moving = state[:, : 2 * holder.part.robot.dimension]
        function = flange_motion_function(holder.part.robot, 1).map(len(state))
        motion[:, : 2 * POSE_SIZE] = np.array(function(moving.T)).T
    return motion


def seen_poses(pose: FloatArray, frames: FloatArray) -> FloatArray:
    """Return poses in a frame that moves, ``[y_C, R_Ce by rows]``, shape (samples, 12).

    Args:
        pose: ``[y_t, R_e by rows]`` in the world, shape (samples, 12).
        frames: ``[p_WC, R_WC by rows, ..]``, shape (samples, 12 or more).
    """
    R_CW = np.swapaxes(frames[:, 3:POSE_SIZE].reshape(-1, 3, 3), 1, 2)
    y_C = np.einsum("kij,kj->ki", R_CW, pose[:, :3] - frames[:, :3])
    R_Ce = R_CW @ pose[:, 3:].reshape(-1, 3, 3)
    return np.hstack([y_C, R_Ce.reshape(-1, 9)])


def add_holder_signals(log: RunLog, station: Station, raw: Raw) -> None:
    """Add where the workpiece is, and what the robot does that holds it.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
    """
    if "workpiece_motion" not in raw:
        return
    holder, frames = station.holder, raw["workpiece_motion"]
    if holder is None:
        log.add("workpiece_pose", frames[:, :POSE_SIZE])
        log.add("y_t_world", placed_points(raw["true_pose"][:, :3], frames))
        angles, rates = np.hsplit(raw[f"{TURNTABLE}motion"], 2)
        log.add("turntable_angles", angles)
        log.add("turntable_rates", rates)
        log.add("frame_error", frame_error(raw[f"{TURNTABLE}frame_jet"], frames))
        return
    own = {name.removeprefix(HOLDER): x for name, x in raw.items() if name.startswith(HOLDER)}
    log.add("workpiece_pose", frames[:, :POSE_SIZE])
    log.add("y_t_world", placed_points(raw["true_pose"][:, :3], frames))
    robot, layout = holder.part.robot, holder.law.layout
    limits = {
        "q_J": robot.gather("position_limits"),
        "v_J": robot.gather("velocity_limit"),
    }
    names = ("q_J", "v_J", "q_M", "v_M") if robot.elastic_joints.any() else ("q_J", "v_J")
    for name, values in zip(names, np.hsplit(own["joint_state"], 4), strict=False):
        log.add(f"{HOLDER}{name}", values, limits=limits.get(name))
    log.add(f"{HOLDER}tau_d", own["law"][:, layout.drive], limits=holder.law.limits)
    coordinates = holder.law.linearization.manifold.coordinates
    m, kinds = len(coordinates), [coordinate.kind.value for coordinate in coordinates]
    told, asked = own["law"][:, layout.manifold_state][:, :m], own["reference"][:, :m]
    for kind in dict.fromkeys(kinds):
        rows = [i for i, own_kind in enumerate(kinds) if own_kind == kind]
        log.add(f"{HOLDER}{kind}", told[:, rows])
        log.add(f"{HOLDER}{kind}_p", asked[:, rows])
    labels = [fault.name.lower() for fault in Fault]
    status = own["law"][:, layout.status]
    log.add(f"{HOLDER}fault", status[:, 0].astype(int), labels=labels)
    if "wrench_ext" in own:
        log.add(f"{HOLDER}wrench", own["wrench_ext"])
    log.add("frame_error", frame_error(own["frame_jet"], frames))


def frame_error(believed: FloatArray, true: FloatArray) -> FloatArray:
    """Return how far the workpiece is from where its motion is told [m, rad], (samples, 2).

    Args:
        believed: ``[p_WC, R_WC by rows, ..]`` as told, shape (samples, 12 or more).
        true: The same as it is.
    """
    off = np.linalg.norm(believed[:, :3] - true[:, :3], axis=1)
    R_1, R_2 = (x[:, 3:POSE_SIZE].reshape(-1, 3, 3) for x in (believed, true))
    # of a small turn, without loss of digits
    chord = np.linalg.norm((R_1 - R_2).reshape(-1, 9), axis=1) / np.sqrt(8.0)
    return np.column_stack([off, 2.0 * np.arcsin(np.minimum(chord, 1.0))])


def holder_metrics(log: RunLog, begin: float) -> Metrics:
    """Return the metrics of two robots, none without one that holds a workpiece.

    Args:
        log: Log of a run.
        begin: Time from which on deviations count [s].
    """
    metrics = Metrics()
    if "workpiece_pose" not in log or log.time.size < 2:
        return metrics
    counting = log.time >= begin
    frames, time = log["workpiece_pose"].values, log.time
    metrics.add("peak_workpiece_speed", peak(_speeds(time, frames[:, :3])))
    turning = 2.0 * np.arcsin(
        np.minimum(np.linalg.norm(np.diff(frames[:, 3:], axis=0), axis=1) / np.sqrt(8.0), 1.0)
    )
    metrics.add("peak_workpiece_turning", peak(turning / np.diff(time)))
    metrics.add("peak_tool_speed_world", peak(_speeds(time, log["y_t_world"].values)))
    held = f"{HOLDER}xi" in log
    if held:
        xi = log.norm(f"{HOLDER}xi")
        metrics.add("max_workpiece_deviation", peak(xi[counting]))
    error = log["frame_error"].values
    metrics.add("max_frame_error", peak(error[counting, 0]))
    metrics.add("max_frame_angle", peak(error[counting, 1]))
    if not held:
        return metrics
    for axis, torque in enumerate(np.abs(log[f"{HOLDER}tau_d"].values).max(axis=0), start=1):
        metrics.add(f"peak_holder_torque_{axis}", float(torque), log[f"{HOLDER}tau_d"].unit)
    return metrics


def _speeds(time: FloatArray, points: FloatArray) -> FloatArray:
    """Return the speed of a point from sample to sample [m/s], shape (samples - 1,)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.asarray(steps / np.diff(time))


def draw_two_arms(log: RunLog) -> style.Drawing:
    """Speeds of tool and workpiece, how the workpiece turns, and how far it is from its belief."""
    canvas, panels = style.make_panels(4)
    pose, time = log["workpiece_pose"].values, log.time
    speeds, turning, slope, belief = panels
    speeds.plot(time, log["eta_dot"].values[:, 0], color="C0", label="along the path")
    speeds.plot(time, _speed(log["y_t_world"].values, time), color="C1", label="tool, world")
    speeds.plot(time, _speed(pose[:, :3], time), color="C2", label="workpiece, world")
    speeds.set(ylabel="speed in m/s", title="Speeds of tool and workpiece")
    style.place_legend(speeds)
    R = pose[:, 3:].reshape(-1, 3, 3)
    turned = np.rad2deg([angle_between(R[:, :, k], R[:1, :, k]) for k in range(3)])
    style.draw_components(turning, time, turned.T, ["x axis", "y axis", "z axis"])
    turning.set(ylabel="angle in deg", title="How far the workpiece's axes are from the start")
    style.place_legend(turning)
    if "holder_xi" in log:
        own = log["holder_xi"].values
        scale, unit = style.fitting_unit(own, "m")
        style.draw_components(slope, time, scale * own, [r"$\xi_1$", r"$\xi_2$"])
        title = "The workpiece beside its own path, as measured"
        slope.set(ylabel=f"deviation in {unit}", title=title)
    else:
        angles = np.rad2deg(log["turntable_angles"].values)
        labels = [f"axis {k + 1}" for k in range(angles.shape[1])]
        style.draw_components(slope, time, angles, labels)
        slope.set(ylabel="angle in deg", title="Axes of the turntable")
    style.place_legend(slope)
    error = log["frame_error"].values
    scale, unit = style.fitting_unit(error[:, :1], "m")
    belief.plot(time, scale * error[:, 0], color="C0")
    belief.set(ylabel=f"distance in {unit}", title="Where it is against where its motion is told")
    caption = (
        "Speeds of the tool on the workpiece and of both in the world, how the workpiece turns, "
        "what carries it, and what the tool's controller cannot know of where it is."
    )
    return style.Drawing("two_arms", "Two arms", caption, canvas)


def draw_holder_torques(log: RunLog) -> style.Drawing:
    """Drive torques of the robot that holds the workpiece, three axes per panel."""
    signal = log["holder_tau_d"]
    groups = [range(i, min(i + 3, signal.dim)) for i in range(0, signal.dim, 3)]
    canvas, panels = style.make_panels(len(groups))
    labels = axis_labels(signal.dim)
    for panel, group in zip(panels, groups, strict=True):
        chosen = [labels[i] for i in group]
        style.draw_components(panel, log.time, signal.values[:, group], chosen)
        panel.set(ylabel=f"torque in {signal.unit}")
        style.place_legend(panel)
    caption = "Torques of the drives of the robot that holds the workpiece."
    return style.Drawing("holder_torques", "Drive torques of the holder", caption, canvas)


def _speed(points: FloatArray, time: FloatArray) -> FloatArray:
    """Return the speed of a point [m/s], shape (samples,)."""
    if len(time) <= _SMOOTHED:
        return np.full(len(time), np.nan)
    rates = np.gradient(points, time, axis=0)
    kernel = np.ones(_SMOOTHED) / _SMOOTHED
    smooth = [np.convolve(rate, kernel, mode="same") for rate in rates.T]
    return np.asarray(np.linalg.norm(smooth, axis=0))


FEATURE = Feature(
    signals=add_holder_signals,
    metrics=lambda log, station, settings: holder_metrics(log, settings.reference.dwell),
    figures={"two_arms": draw_two_arms, "holder_torques": draw_holder_torques},
)
