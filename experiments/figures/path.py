"""The three-dimensional view of a path and of the way the tool point took."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

from experiments.results.run_log import FloatArray, RunLog
from reporting.style import BROAD, COLOURS, INK, REFERENCE, WIDTH, Drawing

ARROW_COUNT = 5
ELEVATION = 28.0  # degrees, of the viewer


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
    if len(lines) == 1:
        axes.plot(*lines[0][:, :2].T, floor, color="#D1D5DB", linewidth=1.0, zorder=1)
        axes.plot(*lines[0].T, label="path $\\gamma$", zorder=2, **BROAD)
    for i, line in enumerate(lines[1:] and lines):
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
