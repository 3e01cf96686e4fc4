"""Coordinates of the path or surface: along it, across it, and their references.

Signals used, as in the log: ``xi`` [samples, 2] m, of a surface [samples, 1], ``eta``, ``eta_p``
[samples, 1] m, of a surface [samples, 2], ``eta_dot`` m/s, ``phi`` [samples, 3] rad, or
[samples, 2] of an axis. A metric over an interval that holds no sample is NaN.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from diagrams.station import Station
from experiments.results.feature import Feature, Raw, by_order, converged_after
from experiments.results.forces_feature import shade_pushes
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.control.law.linearization import virtual_output_function
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MILLI = 1e3
_LATE = 0.2  # s, at the end of a run
_MOVING = 0.01  # m/s, least speed of a moving tool
_SPACE = 3  # tangential coordinates of a freely guided tool
FLOOR = 1e-9  # m or rad; a logarithmic axis cannot show zero
_NAMES = {False: [r"$\eta$"], True: [r"$\eta_1$", r"$\eta_2$"]}
SAME = 1e-6  # m; references closer to each other are drawn as one


def acts_on_truth(station: Station, raw: Raw) -> bool:
    """Return whether the law acts on the actual coordinates of the links.

    Args:
        station: The station.
        raw: Its logged signals.
    """
    return not (station.law.linearization.manifold.follows_time or station.on_motors) and (
        measures_truth(station, raw)
    )


def measures_truth(station: Station, raw: Raw) -> bool:
    """Return whether joints, and the pose of a workpiece, are known exactly.

    Args:
        station: The station.
        raw: Its logged signals.
    """
    # the controller knows a moving workpiece only by its nominal model
    measured = "joint_state_measured" in raw or "workpiece_motion" in raw
    return not measured and station.part.nominal_model.has_actual_kinematics


def add_coordinates(log: RunLog, station: Station, raw: Raw) -> None:
    """Add actual coordinates with rates and references, and those of the law where they differ.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    law, linearization, manifold = (
        station.law,
        station.law.linearization,
        station.task.projected_manifold,
    )
    m, kinds = linearization.num_outputs, _kinds(station)
    Y = by_order(raw["law"][:, law.layout.manifold_state], m).copy()
    if not acts_on_truth(station, raw):
        tracks = linearization.manifold.follows_time
        if tracks:
            log.add("tracking_error", Y[:, 0, :3])
        else:
            _add_law_coordinates(log, station, Y[:, 0], "M" if station.on_motors else "measured")
        # in trajectory tracking, orientation errors remain relative to the moving reference
        rotational = indices(manifold.coordinates, Kind.ROTATIONAL)
        keeps = tracks and rotational.stop > 0
        replaced = slice(0, rotational.start) if keeps else slice(None)
        Y[:, :2, replaced] = _true_output(station, raw)[:, : Y.shape[1], replaced]
    log.add("theta", raw["true_points"][:, manifold.layout.theta])
    log.add("alpha", raw["true_points"][:, manifold.layout.alpha])
    Y_p = by_order(raw["reference"], m)
    for kind, part, labels in kinds:
        name = kind.value
        log.add(name, Y[:, 0, part], labels=labels)
        if not law.stabilization.is_free[part].any():
            log.add(f"{name}_p", Y_p[:, 0, part], labels=[f"{x}_p" for x in labels])
        if linearization.relative_degree > 1:
            log.add(f"{name}_dot", Y[:, 1, part], labels=[f"{x}_dot" for x in labels])
        if "desired_reference" in raw:
            own = [label.replace(name, f"{name}_d", 1) for label in labels]
            log.add(f"{name}_d", raw["desired_reference"][:, :m][:, part], labels=own)


def _add_law_coordinates(log: RunLog, station: Station, y: FloatArray, suffix: str) -> None:
    """Add the coordinates that the law acted on, shape (samples, m)."""
    for kind, part, names in _kinds(station):
        if kind is Kind.ROTATIONAL and suffix == "M":
            continue
        labels = [name.replace(kind.value, f"{kind.value}_{suffix}", 1) for name in names]
        log.add(f"{kind.value}_{suffix}", y[:, part], labels=labels)


def _kinds(station: Station) -> list[tuple[Kind, slice, list[str]]]:
    """Return the kinds of coordinates, their columns and names."""
    coordinates = station.task.projected_manifold.coordinates
    parts = {kind: indices(coordinates, kind) for kind in Kind}
    names = {kind: [c.name for c in coordinates[part]] for kind, part in parts.items()}
    return [(kind, parts[kind], names[kind]) for kind in Kind if names[kind]]


def _true_output(station: Station, raw: Raw) -> FloatArray:
    """Return the virtual output of the links and its rate, shape (samples, 2, m)."""
    n, linearization, points = (
        station.robot.dimension,
        station.law.linearization,
        raw["true_points"],
    )
    if len(points) == 0:
        return np.zeros((0, 2, linearization.num_outputs))
    if "workpiece_motion" in raw:
        points = np.hstack([points, raw["workpiece_motion"]])
    moves = station.holder is not None or station.turntable is not None
    manifold = linearization.manifold if moves else station.task.projected_manifold
    function = virtual_output_function(station.robot, manifold).map(len(points))
    state = raw["joint_state"].T
    Y = np.array(function(state[:n], state[n : 2 * n], points.T))
    return Y.T.reshape(len(points), 2, linearization.num_outputs)


def path_following_metrics(
    log: RunLog, settling_tolerance: float, converged_after: float, min_speed: float
) -> Metrics:
    """Return the path following metrics whose signals the log has.

    Args:
        log: Log of a run.
        settling_tolerance: Distance from the path of a converged tool [m].
        converged_after: Time from which deviations count [s].
        min_speed: Least speed of a moving tool [m/s].
    """
    metrics, counts = Metrics(), log.time >= converged_after
    if "xi" in log:
        distance = log.norm("xi")
        counted, late = distance[counts], log.time >= log.time[-1] - _LATE
        metrics.add("settling_time", settling_time(log, settling_tolerance))
        metrics.add("max_path_deviation", peak(counted))
        if "eta_dot" in log:
            moving = counts & (log.norm("eta_dot") >= min_speed)
            metrics.add("max_path_deviation_while_moving", peak(distance[moving]))
        rms = np.sqrt(np.mean(counted**2)) if counted.size else math.nan
        metrics.add("rms_path_deviation", rms)
        metrics.add("static_path_deviation", np.mean(distance[late]))
    if "xi_d" in log:
        off = np.linalg.norm(log["xi"].values - log["xi_p"].values, axis=1)
        # without a tared sensor the reference does not comply
        tared = "tared" not in log or log["tared"].values.any()
        metrics.add("max_error_from_compliant_reference", peak(off[counts]) if tared else math.nan)
    if "xi_M" in log:
        metrics.add("max_path_deviation_of_motors", peak(log.norm("xi_M")[counts]))
    if "phi" in log:
        metrics.add("max_orientation_error", peak(log.norm("phi")[counts]))
    if "eta" in log:
        # a freely guided tool has no reference
        error = tangential_error(log) if "eta_p" in log else math.nan
        metrics.add("max_tangential_error", error)
    if "eta_dot" in log:
        metrics.add("peak_speed", peak(log.norm("eta_dot")))
    return metrics


def settling_time(log: RunLog, tolerance: float) -> float:
    """Return the time after which |xi| remains at or below a tolerance [m], in s.

    NaN if the last sample is still outside (NaN in the signal counts as outside).
    """
    outside = np.flatnonzero(~(log.norm("xi") <= tolerance))
    first_inside = 0 if outside.size == 0 else int(outside[-1]) + 1
    return float(log.time[first_inside]) if first_inside < log.time.size else math.nan


def tangential_error(log: RunLog, t: float = -math.inf) -> float:
    """Return the largest |eta - eta_p| at times >= t [s], in m."""
    error = np.linalg.norm(log["eta"].values - log["eta_p"].values, axis=1)
    return peak(error[log.time >= t])


def draw_progress(log: RunLog) -> style.Drawing | None:
    """Draw tangential coordinates, references, errors, compliant displacement and speed."""
    eta = log["eta"].values
    if eta.shape[1] >= _SPACE:
        return None
    on_surface = eta.shape[1] == 2
    where = "on the surface" if on_surface else "along the path"
    reference = log["eta_p"].values if "eta_p" in log else None
    desired = None
    if reference is not None and "eta_d" in log:
        desired = log["eta_d"].values
        desired = desired if style.largest(reference - desired) > SAME else None
    shown = []
    # each panel below: values, axis label, title, colour on a path, part of the caption
    rows: list[tuple[FloatArray, str, str, int, str]] = []
    if reference is not None:
        shown.append("their references" if on_surface else "its reference")
        scale, unit = style.fitting_unit(eta - reference, "m")
        title = r"Tangential error $\eta - \eta^p$"
        error = scale * (eta - reference)
        rows.append((error, f"error in {unit}", title, 1, "the error between them"))
    if reference is not None and desired is not None:
        title = r"Displacement of the compliant reference $\eta^p - \eta^d$"
        words = "displacement of the compliant reference by forces"
        rows.append((MILLI * (reference - desired), "displacement in mm", title, 2, words))
    if "eta_dot" in log:
        title = rf"Speed {where} $\dot\eta$"
        rows.append((log["eta_dot"].values, "speed in m/s", title, 0, "the speed"))
    canvas, (position, *further) = style.make_panels(1 + len(rows))
    references = {
        r"$\eta^p$ (reference)": (reference, style.BROAD),
        r"$\eta^d$ (desired)": (desired, {"linestyle": "--", "color": style.INK}),
    }
    for label, (values, line) in references.items():
        for k, column in enumerate([] if values is None else values.T):
            position.plot(log.time, column, label=None if k else label, **line)
    for k, (column, name) in enumerate(zip(eta.T, _NAMES[on_surface], strict=True)):
        position.plot(log.time, column, color=f"C{k}", label=name)
    position.set(ylabel="arc length in m", title=f"Position {where}")
    for panel, (curves, ylabel, title, colour, words) in zip(further, rows, strict=True):
        for k, column in enumerate(curves.T):
            panel.plot(log.time, column, color=f"C{k if on_surface else colour}")
        panel.set(ylabel=ylabel, title=title)
        shown.append(words)
    shade_pushes([position, *further], log)
    style.add_legend(position)
    *first, last = ["Tangential coordinates" if on_surface else "Tangential coordinate", *shown]
    separator = ", and " if len(first) > 1 else " and "
    caption = f"{', '.join(first)}{separator}{last}." if first else f"{last}."
    return style.Drawing("progress", f"Progress {where}", caption, canvas)


def draw_transversal(log: RunLog) -> style.Drawing:
    """Draw transversal coordinates with references, errors or an enlargement, and distances."""
    xi = log["xi"].values
    compliant = is_used(log, "xi_p")
    canvas, panels = style.make_panels(3 if compliant or style.is_dwarfed(log.time, xi) else 2)
    on_surface = xi.shape[1] == 1
    where = "surface" if on_surface else "path"
    labels = [r"$\xi$"] if on_surface else [r"$\xi_1$", r"$\xi_2$"]
    error = draw_with_references(panels[0], log, "xi", r"\xi", labels)
    subject = "Transversal coordinate" if on_surface else "Transversal coordinates"
    panels[0].set(ylabel="deviation in mm", title=subject)
    if error is not None:
        title = r"Error from the reference $\xi - \xi^p$"
        draw_enlarged(panels[1], log.time, error, "m", labels, title)
    elif len(panels) == 3:
        draw_enlarged(panels[1], log.time, xi, "m", labels, "Enlarged")
    distances = {r"$\|\xi\|$": xi}
    for name, label in (("xi_M", r"of the motors $\|\xi_M\|$"), ("xi_measured", "as measured")):
        if name in log:
            distances[label] = log[name].values
    if error is not None:
        distances[r"from the reference $\|\xi - \xi^p\|$"] = error
    panels[-1].set(ylabel="distance in mm")
    draw_sizes(panels[-1], log.time, distances, f"Distance from the {where}")
    shade_pushes(panels, log)
    style.add_legend(panels[0])
    caption = (
        f"{subject}, enlarged if the initial error dominates, and distance from the {where}"
        " on a logarithmic scale."
        if error is None
        else f"{subject} over the compliant reference (broad), the error between them,"
        " and the distances on a logarithmic scale."
    )
    return style.Drawing("transversal", f"Deviation from the {where}", caption, canvas)


def is_used(log: RunLog, reference: str) -> bool:
    """Return whether the log has a reference that differs from zero by more than rounding."""
    return reference in log and style.largest(log[reference].values) > FLOOR


def draw_with_references(
    panel: "Axes", log: RunLog, name: str, symbol: str, labels: list[str]
) -> FloatArray | None:
    """Draw a coordinate over the references that are not zero.

    Args:
        panel: The panel, in thousandths of the log's unit.
        log: With signal ``name``, perhaps ``name_p`` and ``name_d``.
        name: Name of the coordinate.
        symbol: Its symbol in TeX.
        labels: One per component.

    Returns:
        [samples, dim] error from the reference in the log's unit, None if that is zero.
    """
    values = log[name].values
    error = None
    panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    if is_used(log, f"{name}_p"):
        reference = log[f"{name}_p"].values
        style.draw_reference(panel, log.time, MILLI * reference, f"${symbol}^p$ (reference)")
        error = values - reference
    style.draw_components(panel, log.time, MILLI * values, labels)
    if is_used(log, f"{name}_d"):
        # one entry of the legend for all components, which share their colours
        unnamed = [f"_{label}" for label in labels]
        style.draw_components(panel, log.time, MILLI * log[f"{name}_d"].values, unnamed, "--")
        label = f"${symbol}^d$ (desired)"
        style.add_entry(panel, label, color=style.REFERENCE, linestyle="--")
    return error


def draw_enlarged(
    panel: "Axes", time: FloatArray, values: FloatArray, unit: str, labels: list[str], title: str
) -> None:
    """Draw components scaled to the last three quarters of the run, and note it in the title."""
    scale, shown_unit = style.fitting_unit(values[style.late_samples(time)], unit)
    panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    style.draw_components(panel, time, scale * values, labels)
    style.scale_to_late(panel, time, scale * values)
    if style.is_dwarfed(time, values):
        title += ", scaled to the last three quarters"
    panel.set(ylabel=f"deviation in {shown_unit}", title=title)


def draw_sizes(panel: "Axes", time: FloatArray, vectors: dict[str, FloatArray], title: str) -> None:
    """Draw norms, in thousandths, on a logarithmic scale; the title names one, a legend several."""
    panel.set_title(title if len(vectors) > 1 else f"{title} {next(iter(vectors))}")
    for (label, values), colour in zip(vectors.items(), (style.INK, *style.COLOURS), strict=False):
        norm = MILLI * np.maximum(np.linalg.norm(values, axis=1), FLOOR)
        panel.semilogy(time, norm, color=colour, linewidth=1.2, label=label)
    if len(vectors) > 1:
        style.add_legend(panel)


FEATURE = Feature(
    signals=add_coordinates,
    metrics=lambda log, station, settings: path_following_metrics(
        log, settings.settling_tolerance, converged_after(settings, log), _MOVING
    ),
    figures={"progress": draw_progress, "transversal": draw_transversal},
)
