"""Two robots: how the workpiece moves, how the tool does, and what the holder's drives give."""

import numpy as np

from experiments.figures.drives import axis_labels
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import angle_between
from reporting.style import (
    COLOURS,
    Drawing,
    draw_components,
    fitting_unit,
    make_panels,
    place_legend,
)

_SMOOTHED = 5  # samples, of speeds that are differences of true positions


def draw_two_arms(log: RunLog) -> Drawing:
    """Speeds of tool and workpiece, how the workpiece turns, and how far it is from its belief."""
    canvas, panels = make_panels(4)
    pose, time = log["workpiece_pose"].values, log.time
    speeds, turning, slope, belief = panels
    speeds.plot(time, log["eta_dot"].values[:, 0], color=COLOURS[0], label="along the path")
    speeds.plot(time, _speed(log["y_t_world"].values, time), color=COLOURS[1], label="tool, world")
    speeds.plot(time, _speed(pose[:, :3], time), color=COLOURS[2], label="workpiece, world")
    speeds.set(ylabel="speed in m/s", title="Speeds of tool and workpiece")
    place_legend(speeds)
    R = pose[:, 3:].reshape(-1, 3, 3)
    turned = np.rad2deg([angle_between(R[:, :, k], R[:1, :, k]) for k in range(3)])
    draw_components(turning, time, turned.T, ["x axis", "y axis", "z axis"])
    turning.set(ylabel="angle in deg", title="How far the workpiece's axes are from the start")
    place_legend(turning)
    if "holder_xi" in log:
        own = log["holder_xi"].values
        scale, unit = fitting_unit(own, "m")
        draw_components(slope, time, scale * own, [r"$\xi_1$", r"$\xi_2$"])
        title = "The workpiece beside its own path, as measured"
        slope.set(ylabel=f"deviation in {unit}", title=title)
    else:
        angles = np.rad2deg(log["turntable_angles"].values)
        labels = [f"axis {k + 1}" for k in range(angles.shape[1])]
        draw_components(slope, time, angles, labels)
        slope.set(ylabel="angle in deg", title="Axes of the turntable")
    place_legend(slope)
    error = log["frame_error"].values
    scale, unit = fitting_unit(error[:, :1], "m")
    belief.plot(time, scale * error[:, 0], color=COLOURS[0])
    belief.set(ylabel=f"distance in {unit}", title="Where it is against where its motion is told")
    caption = (
        "Speeds of the tool on the workpiece and of both in the world, how the workpiece turns, "
        "what carries it, and what the tool's controller cannot know of where it is."
    )
    return Drawing("two_arms", "Two arms", caption, canvas)


def draw_holder_torques(log: RunLog) -> Drawing:
    """Drive torques of the robot that holds the workpiece, three axes per panel."""
    signal = log["holder_tau_d"]
    groups = [range(i, min(i + 3, signal.dim)) for i in range(0, signal.dim, 3)]
    canvas, panels = make_panels(len(groups))
    labels = axis_labels(signal.dim)
    for panel, group in zip(panels, groups, strict=True):
        chosen = [labels[i] for i in group]
        draw_components(panel, log.time, signal.values[:, group], chosen)
        panel.set(ylabel=f"torque in {signal.unit}")
        place_legend(panel)
    caption = "Torques of the drives of the robot that holds the workpiece."
    return Drawing("holder_torques", "Drive torques of the holder", caption, canvas)


def _speed(points: FloatArray, time: FloatArray) -> FloatArray:
    """Return the speed of a point [m/s], shape (samples,)."""
    if len(time) <= _SMOOTHED:
        return np.full(len(time), np.nan)
    rates = np.gradient(points, time, axis=0)
    kernel = np.ones(_SMOOTHED) / _SMOOTHED
    smooth = [np.convolve(rate, kernel, mode="same") for rate in rates.T]
    return np.asarray(np.linalg.norm(smooth, axis=0))
