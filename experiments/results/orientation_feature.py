"""Orientation of the tool and its reference."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.coordinates_feature import (
    draw_enlarged,
    draw_sizes,
    draw_with_references,
    is_used,
)
from experiments.results.feature import Feature, Raw
from experiments.results.forces_feature import shade_pushes
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.manifolds.manifold import ProjectedManifold
from pfsc_drake.geometry import angle_between, matrix_to_zyx, matrix_to_zyz, turn_about
from reporting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# subject, its error, and caption by the number of angles
_TEXTS = {
    1: (
        "Rotation of the tool",
        "Error of the tool's rotation",
        "Angle of the tool about the yaw axis relative to the path's orientation at its "
        "projection; its tilt is not controlled",
    ),
    2: (
        "Orientation of the tool's axis",
        "Error of the tool's axis",
        "Angles of the tool's axis relative to the path's direction at its projection, about two "
        "perpendicular directions; the rotation about the axis is free",
    ),
    3: (
        "Orientation",
        "Orientation error",
        "{} angles of the tool relative to the path's orientation at its projection",
    ),
}
MIN_SPAN = 2.0  # degrees, least range of an axis of angles


def add_orientation(log: RunLog, station: Station, raw: Raw) -> None:
    """Add the ZYX angles of the tool and of its reference orientation.

    They are ZYZ angles where those are coordinates. The signal ``orientation_lead`` is the angle
    between the reference and the path's orientation at the tool's projection. If only the tool's
    axis is controlled, its directions replace the angles; if only its rotation about an axis in
    space, the rotation relative to the initial reference.

    Args:
        log: Log of the run, which is extended; nothing without an orientation to follow.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    if not station.task.projected_manifold.is_oriented:
        return
    projection, pose = raw["true_points"], raw["true_pose"]
    follows_time = station.law.linearization.manifold.follows_time
    point = raw["manifold_point"] if follows_time else projection
    R_e, R_d = _rotations(station.task.projected_manifold, pose, point)
    _, R_path = _rotations(station.task.projected_manifold, pose, projection)
    unknown = np.logical_not(np.isfinite(point).all(axis=1) & np.isfinite(pose).all(axis=1))
    tool = station.task.projected_manifold.tool
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
    lead = np.full(len(projection), np.nan)
    if yaw_axis is not None:
        lead[~unknown] = np.abs(turn_about(yaw_axis, R_d, R_path))[~unknown]
    elif axis is not None:
        lead[~unknown] = angle_between(R_path @ axis, R_d @ axis)[~unknown]
    elif not unknown.all():
        between = np.swapaxes(R_path, 1, 2) @ R_d
        lead[~unknown] = Rotation.from_matrix(between[~unknown]).magnitude()
    log.add("orientation_lead", lead)


def _rotations(
    manifold: ProjectedManifold, pose: np.ndarray, point: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tool's and the path's orientation, each (samples, 3, 3); I where not finite."""
    finite = np.isfinite(point).all(axis=1) & np.isfinite(pose).all(axis=1)
    R_e = np.where(finite[:, None], pose[:, 3:], np.eye(3).ravel()).reshape(-1, 3, 3)
    R_d = np.tile(np.eye(3), (len(point), 1, 1))
    if finite.any():
        R_d[finite] = manifold.orientation(point[finite])
    return R_e, R_d


def draw_orientation(log: RunLog) -> style.Drawing:
    """Draw orientation errors: components with references, and their norm."""
    canvas, panels = style.make_panels(3 if is_used(log, "phi_p") else 2)
    angles = log["phi"].dim
    labels = [r"$\varphi$ (about z)", r"$\vartheta$ (about y)", r"$\psi$ (about x)"]
    if _convention(log["phi"].labels) == "ZYZ":
        labels[2] = r"$\psi$ (about z again)"
    if angles < 3:
        labels = [r"$\varphi$", r"$\vartheta$"][:angles]
    error = draw_with_references(panels[0], log, "phi", r"\phi", labels)
    subject, fault, caption = _TEXTS[angles]
    name = f"{subject} relative to the path" if error is not None else fault
    panels[0].set(ylabel="angle in mrad", title=name)
    sizes = {r"$\|\phi\|$": log["phi"].values}
    if error is not None:
        title = r"Error from the reference $\phi - \phi^p$"
        draw_enlarged(panels[1], log.time, error, "rad", labels, title)
        sizes[r"from the reference $\|\phi - \phi^p\|$"] = error
    panels[-1].set(ylabel="norm in mrad")
    draw_sizes(panels[-1], log.time, sizes, "Norm of the angles")
    shade_pushes(panels, log)
    style.add_legend(panels[0])
    caption = caption.format(_convention(log["phi"].labels))
    caption += "." if error is None else ", over the compliant reference (broad)."
    return style.Drawing("orientation", name, caption, canvas)


def _convention(labels: Sequence[str]) -> str:
    """Return the Euler angle convention of labels; the last label of ZYZ ends with ``z2``."""
    return "ZYZ" if labels[-1].endswith("z2") else "ZYX"


def draw_angles(log: RunLog) -> style.Drawing:
    """Draw the angles of tool and reference orientation, in one panel each."""
    tool, path = (np.rad2deg(log[name].values) for name in ("angles_e", "angles_d"))
    tool = tool + _whole_turns(path - tool)
    canvas, panels = style.make_panels(tool.shape[1], height=1.9)
    for column, (panel, axis) in enumerate(zip(panels, log["angles_e"].labels, strict=True)):
        panel.plot(log.time, path[:, column], label=r"reference $R_d$", **style.BROAD)
        panel.plot(log.time, tool[:, column], color=f"C{column}", label=f"tool, about {axis}")
        _keep_span(panel, MIN_SPAN)
        panel.set(ylabel="angle in deg", title=f"Rotation about {axis}")
    shade_pushes(panels, log)
    # the tool has another colour in each panel
    for panel in panels:
        style.add_legend(panel)
    angles = f"{_convention(log['angles_e'].labels)} angles"
    if tool.shape[1] == 1:
        angles = "Rotation about the yaw axis since the start"
    caption = (
        f"{angles} of tool and reference in the world: the reference is a function of time,"
        " independent of the tool."
        if "tracking_error" in log
        else f"{angles} of tool and path in the world: the reference is a function of the tool's"
        " projection on the path, and waits if the tool waits."
    )
    return style.Drawing("angles", "Orientation of tool and reference", caption, canvas)


def draw_axis(log: RunLog) -> style.Drawing:
    """Draw the direction of the tool's axis and its reference, and the angle between them."""
    tool, path = log["axis_e"].values, log["axis_d"].values
    canvas, (direction, between) = style.make_panels(2)
    style.draw_reference(direction, log.time, path, "reference")
    style.draw_components(direction, log.time, tool, log["axis_e"].labels)
    direction.set(ylabel="component", title="Direction of the tool's axis in the world")
    angle = angle_between(tool, path)
    between.set(ylabel="angle in mrad")
    draw_sizes(between, log.time, {"and its reference": angle[:, None]}, "Angle between the axis")
    shade_pushes([direction, between], log)
    style.add_legend(direction)
    waits = (
        "is a function of time, independent of the tool."
        if "tracking_error" in log
        else "is a function of the tool's projection on the path, and waits if the tool waits."
    )
    caption = (
        "Axis of the tool, about which its rotation is free, and reference direction, which "
        f"{waits}"
    )
    return style.Drawing("axis", "Direction of the tool's axis and its reference", caption, canvas)


def _whole_turns(difference: FloatArray) -> FloatArray:
    """Return whole turns [deg] in each column of a difference of angles, shape (columns,).

    180 deg and -180 deg are the same orientation.
    """
    known = difference[np.isfinite(difference).all(axis=1)]
    if not len(known):
        return np.zeros(difference.shape[1])
    return 360.0 * np.round(np.median(known, axis=0) / 360.0)


def _keep_span(panel: "Axes", span: float) -> None:
    """Widen an axis to a least span, so that rounding does not appear as motion."""
    low, high = panel.get_ylim()
    if high - low < span:
        centre = 0.5 * (low + high)
        panel.set_ylim(centre - 0.5 * span, centre + 0.5 * span)


def _known(_station: Station, settings: Scenario) -> set[str]:
    """Return the signal of an orientation that is not controlled."""
    surface = settings.surface
    free = settings.path.orientation.task == "none"
    return {"phi"} if free or (surface and surface.orientation.kind == "none") else set()


FEATURE = Feature(
    signals=add_orientation,
    known=_known,
    figures={"orientation": draw_orientation, "angles": draw_angles, "axis": draw_axis},
)
