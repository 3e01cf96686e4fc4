"""Moving workpiece: its robot or turntable, and the tool on it."""

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

_SMOOTHED = 5  # samples, of speeds that are differences of actual positions


def workpiece_motion(station: Station, raw: Raw) -> FloatArray | None:
    """Return the actual motion of the workpiece, up to its velocity.

    Args:
        station: The station that was simulated.
        raw: Its logged signals.

    Returns:
        Derivatives 0..r of ``[p_WC, R_WC by rows]``, zero from the second on, shape (samples, 12 (r
        + 1)); None of a station without moving workpiece.
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


def relative_poses(pose: FloatArray, frames: FloatArray) -> FloatArray:
    """Return poses relative to a moving frame, ``[y_C, R_Ce by rows]``, shape (samples, 12).

    Args:
        pose: ``[y_t, R_e by rows]`` in the world, shape (samples, 12).
        frames: ``[p_WC, R_WC by rows, ..]``, shape (samples, 12 or more).
    """
    R_CW = np.swapaxes(frames[:, 3:POSE_SIZE].reshape(-1, 3, 3), 1, 2)
    y_C = np.einsum("kij,kj->ki", R_CW, pose[:, :3] - frames[:, :3])
    R_Ce = R_CW @ pose[:, 3:].reshape(-1, 3, 3)
    return np.hstack([y_C, R_Ce.reshape(-1, 9)])


def add_holder_signals(log: RunLog, station: Station, raw: Raw) -> None:
    """Add the pose of the workpiece, and signals of its robot or turntable.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
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
    output, reference = own["law"][:, layout.manifold_state][:, :m], own["reference"][:, :m]
    for kind in dict.fromkeys(kinds):
        rows = [i for i, own_kind in enumerate(kinds) if own_kind == kind]
        log.add(f"{HOLDER}{kind}", output[:, rows])
        log.add(f"{HOLDER}{kind}_p", reference[:, rows])
    labels = [fault.name.lower() for fault in Fault]
    status = own["law"][:, layout.status]
    log.add(f"{HOLDER}fault", status[:, 0].astype(int), labels=labels)
    if "wrench_ext" in own:
        log.add(f"{HOLDER}wrench", own["wrench_ext"])
    log.add("frame_error", frame_error(own["frame_jet"], frames))


def frame_error(nominal: FloatArray, actual: FloatArray) -> FloatArray:
    """Return the pose error of the workpiece's reported motion [m, rad], shape (samples, 2).

    Args:
        nominal: Reported ``[p_WC, R_WC by rows, ..]``, shape (samples, 12 or more).
        actual: Actual ``[p_WC, R_WC by rows, ..]``, same shape.
    """
    off = np.linalg.norm(nominal[:, :3] - actual[:, :3], axis=1)
    R_1, R_2 = (x[:, 3:POSE_SIZE].reshape(-1, 3, 3) for x in (nominal, actual))
    # of a small rotation, without loss of digits
    chord = np.linalg.norm((R_1 - R_2).reshape(-1, 9), axis=1) / np.sqrt(8.0)
    return np.column_stack([off, 2.0 * np.arcsin(np.minimum(chord, 1.0))])


def holder_metrics(log: RunLog, begin: float) -> Metrics:
    """Return the metrics of a moving workpiece, none without one.

    Args:
        log: Log of a run.
        begin: Time from which deviations count [s].
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
    has_robot = f"{HOLDER}xi" in log
    if has_robot:
        xi = log.norm(f"{HOLDER}xi")
        metrics.add("max_workpiece_deviation", peak(xi[counting]))
    error = log["frame_error"].values
    metrics.add("max_frame_error", peak(error[counting, 0]))
    metrics.add("max_frame_angle", peak(error[counting, 1]))
    if not has_robot:
        return metrics
    for axis, torque in enumerate(np.abs(log[f"{HOLDER}tau_d"].values).max(axis=0), start=1):
        metrics.add(f"peak_holder_torque_{axis}", float(torque), log[f"{HOLDER}tau_d"].unit)
    return metrics


def _speeds(time: FloatArray, points: FloatArray) -> FloatArray:
    """Return the speed of a point from sample to sample [m/s], shape (samples - 1,)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.asarray(steps / np.diff(time))


def draw_two_arms(log: RunLog) -> style.Drawing:
    """Draw speeds of tool and workpiece, the workpiece's rotation, and its pose error."""
    canvas, panels = style.make_panels(4)
    pose, time = log["workpiece_pose"].values, log.time
    speeds, turning, slope, pose_error = panels
    speeds.plot(time, log["eta_dot"].values[:, 0], color="C0", label="along the path")
    speeds.plot(time, _speed(log["y_t_world"].values, time), color="C1", label="tool, world")
    speeds.plot(time, _speed(pose[:, :3], time), color="C2", label="workpiece, world")
    speeds.set(ylabel="speed in m/s", title="Speeds of tool and workpiece")
    style.add_legend(speeds)
    R = pose[:, 3:].reshape(-1, 3, 3)
    turned = np.rad2deg([angle_between(R[:, :, k], R[:1, :, k]) for k in range(3)])
    style.draw_components(turning, time, turned.T, ["x axis", "y axis", "z axis"])
    turning.set(ylabel="angle in deg", title="Rotation of the workpiece's axes from the start")
    style.add_legend(turning)
    if "holder_xi" in log:
        own = log["holder_xi"].values
        scale, unit = style.fitting_unit(own, "m")
        style.draw_components(slope, time, scale * own, [r"$\xi_1$", r"$\xi_2$"])
        title = "Measured deviation of the workpiece from its own path"
        slope.set(ylabel=f"deviation in {unit}", title=title)
    else:
        angles = np.rad2deg(log["turntable_angles"].values)
        labels = [f"axis {k + 1}" for k in range(angles.shape[1])]
        style.draw_components(slope, time, angles, labels)
        slope.set(ylabel="angle in deg", title="Axes of the turntable")
    style.add_legend(slope)
    error = log["frame_error"].values
    scale, unit = style.fitting_unit(error[:, :1], "m")
    pose_error.plot(time, scale * error[:, 0], color="C0")
    pose_error.set(ylabel=f"distance in {unit}", title="Position error of the reported motion")
    caption = (
        "Speeds of the tool on the workpiece and of both in the world, rotation of the workpiece, "
        "motion of its robot or turntable, and position error unknown to the tool's controller."
    )
    return style.Drawing("two_arms", "Two arms", caption, canvas)


def draw_holder_torques(log: RunLog) -> style.Drawing:
    """Draw drive torques of the workpiece robot, three axes per panel."""
    signal = log["holder_tau_d"]
    groups = [range(i, min(i + 3, signal.dim)) for i in range(0, signal.dim, 3)]
    canvas, panels = style.make_panels(len(groups))
    labels = axis_labels(signal.dim)
    for panel, group in zip(panels, groups, strict=True):
        chosen = [labels[i] for i in group]
        style.draw_components(panel, log.time, signal.values[:, group], chosen)
        panel.set(ylabel=f"torque in {signal.unit}")
        style.add_legend(panel)
    caption = "Drive torques of the workpiece robot."
    return style.Drawing("holder_torques", "Drive torques of the workpiece robot", caption, canvas)


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
