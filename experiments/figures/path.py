"""A path or a surface in space and the way of the tool; in its notch; over points it fits."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from reporting.style import BROAD, COLOURS, INK, REFERENCE, WIDTH, Drawing, fitting_unit

ARROW_COUNT = 5
ELEVATION = 28.0  # degrees, of the viewer
_SIZE = 5.0  # inches
_MARGIN = 1.25  # of the picture, beyond the farthest point
_BINS = 40
_ROOM = 1.05  # of the largest distance


def draw_path(log: RunLog, outline: Sequence[FloatArray]) -> Drawing:
    """Path and driven output with start, end and direction of travel; equal scales on all axes.

    Args:
        log: With ``y_t`` [samples, 3] m.
        outline: Lines that show what is followed, each [k, 3] m; one of a path.
    """
    canvas = Canvas(figsize=(WIDTH, 5.6))
    axes = canvas.add_subplot(projection="3d", computed_zorder=False)
    assert isinstance(axes, Axes3D)
    output = log["y_t"].values
    output = output[np.all(np.isfinite(output), axis=1)]
    lines = [np.asarray(line, dtype=float).reshape(-1, 3) for line in outline]
    floor = _set_equal_scales(axes, np.vstack([*lines, output]))
    comes = "way_left" in log  # its way points do
    if len(lines) == 1 or comes:
        for i, line in enumerate(lines):
            axes.plot(*line[:, :2].T, floor, color="#D1D5DB", linewidth=1.0, zorder=1)
            name = "way points" if comes else "path $\\gamma$"
            axes.plot(*line.T, label=None if i else name, zorder=2, **BROAD)
    for i, line in enumerate([] if comes else lines[1:] and lines):
        label = None if i else r"surface $\mathcal{S}$"
        axes.plot(*line.T, color=REFERENCE, linewidth=0.7, label=label, zorder=2)
    axes.plot(*output.T, color=COLOURS[0], linewidth=1.6, label="tool point $y_t$", zorder=3)
    _draw_direction(axes, output)
    ends = (
        ()
        if len(output) == 0
        else (
            (0, "o", COLOURS[2], "start"),
            (-1, "s", COLOURS[1], "end"),
        )
    )
    for row, marker, colour, label in ends:
        axes.plot(
            *output[row][:, np.newaxis],
            marker=marker,
            color=colour,
            markeredgecolor="white",
            markersize=10,
            linestyle="none",
            label=label,
            zorder=5,
        )
    for artist in (*axes.lines, *axes.collections):
        # a wide box reaches beyond the square that is called the axes
        artist.set_clip_on(False)
        artist.set_in_layout(False)
    axes.set_xlabel("x in m", labelpad=12)
    axes.set_ylabel("y in m", labelpad=8)
    axes.set_zlabel("z in m", labelpad=4)
    canvas.legend(loc="outside upper left", ncols=4, handlelength=1.6, columnspacing=1.4)
    if comes:
        caption = (
            "Way points, joined by lines, their shadow on the floor, and the tool point's way."
        )
        return Drawing("path", "Way points and driven output", caption, canvas)
    if len(lines) > 1:
        caption = "The surface, by lines of its parameters, and the tool point's way."
        return Drawing("path", "Surface and driven output", caption, canvas)
    caption = "The path, its shadow on the floor, and the tool point's way."
    return Drawing("path", "Path and driven output", caption, canvas)


def _set_equal_scales(axes: Axes3D, points: FloatArray) -> float:
    """Sets limits around all points, equal scales, few ticks and a quiet background.

    Returns:
        Lower limit of z [m], where the path's shadow is drawn.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    # A flat path still needs a box with some depth.
    span = np.maximum(high - low, 0.35 * max(float(np.max(high - low)), 1e-3)) * 1.1
    centre = 0.5 * (low + high)
    low, high = centre - span / 2, centre + span / 2
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    # the longer side runs across the picture
    azimuth = -58.0 if span[0] >= span[1] else -28.0
    axes.view_init(elev=ELEVATION, azim=azimuth)
    axes.set_box_aspect(span, zoom=_zoom(span, azimuth))
    for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), span / span.max(), strict=True):
        axis.set_major_locator(MaxNLocator(nbins=max(2, round(6 * share))))
        axis.set_pane_color((0.975, 0.98, 0.985, 1.0))
        axis.line.set_color(REFERENCE)
    return float(low[2])


def _zoom(span: FloatArray, azimuth: float) -> float:
    """Zoom at which a box fills the picture, higher or wider, and its labels are still inside."""
    x, y, z = span / np.linalg.norm(span)
    sin_a, cos_a = np.abs([np.sin(np.deg2rad(azimuth)), np.cos(np.deg2rad(azimuth))])
    sin_e, cos_e = np.sin(np.deg2rad(ELEVATION)), np.cos(np.deg2rad(ELEVATION))
    width, height = x * sin_a + y * cos_a, z * cos_e + (x * cos_a + y * sin_a) * sin_e
    return float(min(0.87 / height, 1.2 / width))


def _draw_direction(axes: Axes3D, output: FloatArray) -> None:
    """Arrow heads along the way, at equal distances travelled."""
    steps = np.linalg.norm(np.diff(output, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    if travelled[-1] == 0.0:
        return
    size = 0.03 * float(np.max(np.ptp(output, axis=0)))
    for share in np.linspace(0.0, 1.0, ARROW_COUNT + 2)[1:-1]:
        target = share * travelled[-1]
        here, ahead = (
            np.array([np.interp(s, travelled, column) for column in output.T])
            for s in (target, target + 0.5 * size)
        )
        direction = ahead - here
        norm = float(np.linalg.norm(direction))
        if norm > 0.0:
            axes.quiver(
                *here,
                *(size * direction / norm),
                color=INK,
                arrow_length_ratio=1.0,
                linewidth=2.0,
                zorder=4,
            )


def draw_notch_position(log: RunLog) -> Drawing:
    """Way of the ball's centre in the notch, with the circle in which it touches nothing."""
    signal = log["notch_position"]
    left, above = 1e3 * signal.values.T
    canvas = Canvas(figsize=(_SIZE, _SIZE))
    panel = canvas.subplots()
    panel.plot(-left, above, color=COLOURS[0], linewidth=1.0, label="centre of the ball")
    panel.plot(-left[:1], above[:1], "o", color=COLOURS[2], label="start")
    reach = float(np.nanmax(np.abs(signal.values))) * 1e3
    if signal.limits is not None:
        free = 1e3 * float(np.max(signal.limits))
        angle = np.linspace(0.0, 2.0 * np.pi, 181)
        panel.plot(
            free * np.cos(angle), free * np.sin(angle), "--", color=INK, label="free of contact"
        )
        reach = max(reach, free)
    for draw_axis in (panel.axhline, panel.axvline):
        draw_axis(0.0, color=REFERENCE, linewidth=0.8)
    span = _MARGIN * reach
    panel.set(xlim=(-span, span), ylim=(-span, span), aspect="equal")
    panel.set(xlabel="to the right of the notch's axis in mm", ylabel="above it in mm")
    panel.set_title("Ball in the notch, seen along the path")
    panel.legend(loc="upper right")
    return Drawing(
        "notch",
        "Ball in the notch",
        "Centre of the ball in the cross-section of the notch; outside the dashed circle its soft "
        "shell is pressed.",
        canvas,
    )


def draw_surface_fit(fit: Residuals) -> Drawing:
    """Distances of points from a surface: where over it, and how many of which size.

    Args:
        fit: Where the points stand.
    """
    scale, unit = fitting_unit(fit.distances, "m")
    distances, reach = scale * fit.distances, _ROOM * scale * fit.largest or 1.0
    canvas = Canvas(figsize=(WIDTH, 4.2))
    over, counted = canvas.subplots(1, 2, width_ratios=(3, 2))
    dots = over.scatter(
        *fit.theta.T, c=distances, s=8.0, cmap="RdBu_r", vmin=-reach, vmax=reach, linewidths=0.0
    )
    canvas.colorbar(dots, ax=over, label=f"distance in {unit}")
    over.set(xlabel=r"$\theta_1$", ylabel=r"$\theta_2$", title="Over the surface")
    over.grid(visible=False)
    counted.hist(distances, bins=_BINS, range=(-reach, reach), color=COLOURS[0])
    for sign in (-1.0, 1.0):
        label = f"root mean square {scale * fit.rms:.3g} {unit}" if sign > 0.0 else None
        counted.axvline(sign * scale * fit.rms, linestyle="--", color=INK, label=label)
    counted.set(xlabel=f"distance in {unit}", ylabel="points", title=" ")
    counted.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
    caption = (
        f"Distances of {len(distances)} points from the surface fitted to them, along its normal, "
        f"at most {np.abs(distances).max():.3g} {unit}; they should show no pattern."
    )
    return Drawing("surface_fit", "Points and the surface fitted to them", caption, canvas)
