"""The coordinates of the path over time: along, across, and orientation."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from experiments.figures.forces import shade_pushes
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import angle_between
from reporting.style import (
    BROAD,
    COLOURS,
    INK,
    REFERENCE,
    Drawing,
    draw_components,
    draw_reference,
    fitting_unit,
    is_dwarfed,
    largest,
    late_samples,
    make_panels,
    place_legend,
    scale_to_late,
)

MILLI = 1e3
FLOOR = 1e-9  # m or rad; zero has no place on a logarithmic axis
SAME = 1e-6  # m; references nearer to each other are drawn as one
MIN_SPAN = 2.0  # degrees, that an axis of angles shows at least


def draw_progress(log: RunLog) -> Drawing:
    """Tangential coordinates with references, errors, how far they yield, and the speed."""
    eta = log["eta"].values
    on_surface = eta.shape[1] == 2
    where = "on the surface" if on_surface else "along the path"
    names = ["_1", "_2"] if on_surface else [""]
    reference = log["eta_p"].values if "eta_p" in log else None
    desired = None
    if reference is not None and "eta_d" in log:
        desired = log["eta_d"].values
        desired = desired if largest(reference - desired) > SAME else None
    rows = 1 + (reference is not None) + (desired is not None) + ("eta_dot" in log)
    canvas, panels = make_panels(rows)
    position, *further = panels
    if reference is not None:
        for k, column in enumerate(reference.T):
            label = r"$\eta^p$ (reference)" if k == 0 else None
            position.plot(log.time, column, label=label, **BROAD)
        error = further.pop(0)
        scale, unit = fitting_unit(eta - reference, "m")
        for k, column in enumerate((eta - reference).T):
            error.plot(log.time, scale * column, color=COLOURS[k if on_surface else 1])
        error.set(ylabel=f"error in {unit}", title=r"Tangential error $\eta - \eta^p$")
    if reference is not None and desired is not None:
        yielding = further.pop(0)
        for k, column in enumerate(desired.T):
            label = r"$\eta^d$ (desired)" if k == 0 else None
            position.plot(log.time, column, "--", color=INK, label=label)
            colour = COLOURS[k if on_surface else 2]
            yielding.plot(log.time, MILLI * (reference[:, k] - column), color=colour)
        yielding.set(ylabel="way in mm", title=r"How far the reference yields $\eta^p - \eta^d$")
    for k, (column, name) in enumerate(zip(eta.T, names, strict=True)):
        position.plot(log.time, column, color=COLOURS[k], label=rf"$\eta{name}$")
    position.set(ylabel="arc length in m", title=f"Position {where}")
    if further:
        speed = further.pop(0)
        for k, column in enumerate(log["eta_dot"].values.T):
            speed.plot(log.time, column, color=COLOURS[k])
        speed.set(ylabel="speed in m/s", title=rf"Speed {where} $\dot\eta$")
    shade_pushes(panels, log)
    place_legend(position)
    shown = [
        *(["their references"] * on_surface or ["its reference"] if reference is not None else []),
        *(["the error between them"] if reference is not None else []),
        *(["how far the reference yields to forces"] if desired is not None else []),
        *(["the speed"] if "eta_dot" in log else []),
    ]
    *first, last = ["Tangential coordinates" if on_surface else "Tangential coordinate", *shown]
    separator = ", and " if len(first) > 1 else " and "
    caption = f"{', '.join(first)}{separator}{last}." if first else f"{last}."
    return Drawing("progress", f"Progress {where}", caption, canvas)


def draw_transversal(log: RunLog) -> Drawing:
    """Transversal coordinates with references, the error or an enlargement, and log distances."""
    xi = log["xi"].values
    compliant = _is_used(log, "xi_p")
    canvas, panels = make_panels(3 if compliant or is_dwarfed(log.time, xi) else 2)
    on_surface = xi.shape[1] == 1
    where = "surface" if on_surface else "path"
    labels = [r"$\xi$"] if on_surface else [r"$\xi_1$", r"$\xi_2$"]
    error = _draw_with_references(panels[0], log, "xi", r"\xi", labels)
    subject = "Transversal coordinate" if on_surface else "Transversal coordinates"
    panels[0].set(ylabel="deviation in mm", title=subject)
    if error is not None:
        title = r"Error from the reference $\xi - \xi^p$"
        _draw_enlarged(panels[1], log.time, error, "m", labels, title)
    elif len(panels) == 3:
        _draw_enlarged(panels[1], log.time, xi, "m", labels, "The same")
    distances = {r"$\|\xi\|$": xi}
    for name, label in (("xi_M", r"of the motors $\|\xi_M\|$"), ("xi_measured", "as measured")):
        if name in log:
            distances[label] = log[name].values
    if error is not None:
        distances[r"from the reference $\|\xi - \xi^p\|$"] = error
    panels[-1].set(ylabel="distance in mm")
    _draw_sizes(panels[-1], log.time, distances, f"Distance from the {where}")
    shade_pushes(panels, log)
    place_legend(panels[0])
    caption = (
        f"{subject}, enlarged where the start dwarfs the rest, and the distance from"
        f" the {where} on a logarithmic scale."
        if error is None
        else f"{subject} over the reference that yields to forces (broad), what lies"
        " between the two, and the distances on a logarithmic scale."
    )
    return Drawing("transversal", f"Deviation from the {where}", caption, canvas)


def draw_orientation(log: RunLog) -> Drawing:
    """Orientation errors: components with references and, on a logarithmic scale, their norm."""
    canvas, panels = make_panels(3 if _is_used(log, "phi_p") else 2)
    angles = log["phi"].dim
    of_axis, of_yaw = angles == 2, angles == 1
    labels = [r"$\varphi$ (about z)", r"$\vartheta$ (about y)", r"$\psi$ (about x)"]
    if _convention(log["phi"].labels) == "ZYZ":
        labels[2] = r"$\psi$ (about z again)"
    if angles < 3:
        labels = [r"$\varphi$", r"$\vartheta$"][:angles]
    error = _draw_with_references(panels[0], log, "phi", r"\phi", labels)
    subject = "Orientation of the tool's axis" if of_axis else "Orientation"
    fault = "Error of the tool's axis" if of_axis else "Orientation error"
    if of_yaw:
        subject, fault = "Turn of the tool", "Error of the tool's turn"
    name = f"{subject} relative to the path" if error is not None else fault
    panels[0].set(ylabel="angle in mrad", title=name)
    sizes = {r"$\|\phi\|$": log["phi"].values}
    if error is not None:
        title = r"Error from the reference $\phi - \phi^p$"
        _draw_enlarged(panels[1], log.time, error, "rad", labels, title)
        sizes[r"from the reference $\|\phi - \phi^p\|$"] = error
    panels[-1].set(ylabel="norm in mrad")
    _draw_sizes(panels[-1], log.time, sizes, "Size of the angles")
    shade_pushes(panels, log)
    place_legend(panels[0])
    caption = (
        "Angles by which the tool's axis is turned away from the direction that belongs to its"
        " place, about two directions across it; the turn about the axis is free"
        if of_axis
        else f"{_convention(log['phi'].labels)} angles of the tool against the orientation that"
        " belongs to its place"
    )
    if of_yaw:
        caption = (
            "Angle by which the tool is turned about the yaw axis against the orientation that"
            " belongs to its place; its tilt is no task"
        )
    caption += "." if error is None else ", over the reference that yields to torques (broad)."
    return Drawing("orientation", name, caption, canvas)


def _convention(labels: Sequence[str]) -> str:
    """Return the convention of Euler angles with these labels, of which ZYZ's second z has a 2."""
    return "ZYZ" if labels[-1].endswith("z2") else "ZYX"


def draw_angles(log: RunLog) -> Drawing:
    """Angles of the tool over those of the reference orientation, a panel for each."""
    tool, path = (np.rad2deg(log[name].values) for name in ("angles_e", "angles_d"))
    tool = tool + _whole_turns(path - tool)
    canvas, panels = make_panels(tool.shape[1], height=1.9)
    for column, (panel, axis) in enumerate(zip(panels, log["angles_e"].labels, strict=True)):
        panel.plot(log.time, path[:, column], label=r"reference $R_d$", **BROAD)
        panel.plot(log.time, tool[:, column], color=COLOURS[column], label=f"tool, about {axis}")
        _keep_span(panel, MIN_SPAN)
        panel.set(ylabel="angle in deg", title=f"Rotation about {axis}")
    shade_pushes(panels, log)
    # the tool has another colour in each panel
    for panel in panels:
        place_legend(panel)
    angles = f"{_convention(log['angles_e'].labels)} angles"
    if tool.shape[1] == 1:
        angles = "Turns about the yaw axis since the start"
    caption = (
        f"{angles} of tool and reference in the world: the reference belongs to a point that"
        " moves with time and runs on, whatever holds the tool."
        if "tracking_error" in log
        else f"{angles} of tool and path in the world: the reference belongs to the place of the"
        " tool on the path and waits where the tool waits."
    )
    return Drawing("angles", "Orientation of tool and reference", caption, canvas)


def draw_axis(log: RunLog) -> Drawing:
    """Direction of the tool's axis over that of its reference, and the angle between them."""
    tool, path = log["axis_e"].values, log["axis_d"].values
    canvas, (direction, between) = make_panels(2)
    draw_reference(direction, log.time, path, "reference")
    draw_components(direction, log.time, tool, log["axis_e"].labels)
    direction.set(ylabel="component", title="Direction of the tool's axis in the world")
    angle = angle_between(tool, path)
    between.set(ylabel="angle in mrad")
    _draw_sizes(between, log.time, {"and its reference": angle[:, None]}, "Angle between the axis")
    shade_pushes([direction, between], log)
    place_legend(direction)
    waits = (
        "belongs to a point that moves with time and runs on, whatever holds the tool."
        if "tracking_error" in log
        else "belongs to the place of the tool on the path and waits where the tool waits."
    )
    caption = (
        "Axis of the tool, about which it may turn as it likes, and the direction that it is to"
        f" have, which {waits}"
    )
    return Drawing("axis", "Direction of the tool's axis and its reference", caption, canvas)


def _whole_turns(difference: FloatArray) -> FloatArray:
    """Whole turns [deg] in each column of a difference of angles, shape (columns,).

    A tool that points down is at 180 deg as well as at -180 deg.
    """
    known = difference[np.isfinite(difference).all(axis=1)]
    if not len(known):
        return np.zeros(difference.shape[1])
    return 360.0 * np.round(np.median(known, axis=0) / 360.0)


def _is_used(log: RunLog, reference: str) -> bool:
    """Whether a reference is in the log and anywhere other than zero, but for rounding."""
    return reference in log and largest(log[reference].values) > FLOOR


def _draw_with_references(
    panel: Axes, log: RunLog, name: str, symbol: str, labels: list[str]
) -> FloatArray | None:
    """Draws a coordinate over the references that are not zero.

    Args:
        panel: Where to draw, in thousandths of the log's unit.
        log: With signal ``name``, perhaps ``name_p`` and ``name_d``.
        name: Name of the coordinate.
        symbol: The same in TeX.
        labels: One per component.

    Returns:
        [samples, dim] error from the reference in the log's unit, None if that is zero.
    """
    values = log[name].values
    error = None
    panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
    if _is_used(log, f"{name}_p"):
        reference = log[f"{name}_p"].values
        draw_reference(panel, log.time, MILLI * reference, f"${symbol}^p$ (reference)")
        error = values - reference
    draw_components(panel, log.time, MILLI * values, labels)
    if _is_used(log, f"{name}_d"):
        # one entry of the legend for all components, which share their colours
        unnamed = [f"_{label}" for label in labels]
        draw_components(panel, log.time, MILLI * log[f"{name}_d"].values, unnamed, "--")
        label = f"${symbol}^d$ (desired)"
        panel.add_line(Line2D([], [], color=REFERENCE, linestyle="--", label=label))
    return error


def _draw_enlarged(
    panel: Axes, time: FloatArray, values: FloatArray, unit: str, labels: list[str], title: str
) -> None:
    """Draws components scaled to the last three quarters of the run, and says so if it matters."""
    scale, shown_unit = fitting_unit(values[late_samples(time)], unit)
    panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
    draw_components(panel, time, scale * values, labels)
    scale_to_late(panel, time, scale * values)
    if is_dwarfed(time, values):
        title += ", scaled to the last three quarters"
    panel.set(ylabel=f"deviation in {shown_unit}", title=title)


def _draw_sizes(panel: Axes, time: FloatArray, vectors: dict[str, FloatArray], title: str) -> None:
    """Norms, in thousandths, on a logarithmic scale; the title names one, a legend several."""
    panel.set_title(title if len(vectors) > 1 else f"{title} {next(iter(vectors))}")
    for (label, values), colour in zip(vectors.items(), (INK, *COLOURS), strict=False):
        norm = MILLI * np.maximum(np.linalg.norm(values, axis=1), FLOOR)
        panel.semilogy(time, norm, color=colour, linewidth=1.2, label=label)
    if len(vectors) > 1:
        place_legend(panel)


def _keep_span(panel: Axes, span: float) -> None:
    """Widens an axis that shows less, so that rounding does not look like motion."""
    low, high = panel.get_ylim()
    if high - low < span:
        centre = 0.5 * (low + high)
        panel.set_ylim(centre - 0.5 * span, centre + 0.5 * span)
