"""How far points are from the surface that was fitted to them."""

import numpy as np
from matplotlib.figure import Figure as Canvas

from pfsc_drake.geometry.surfaces.residuals import Residuals
from reporting.style import COLOURS, INK, WIDTH, Drawing, fitting_unit

_BINS = 40
_ROOM = 1.05  # of the largest distance


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
