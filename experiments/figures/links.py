"""How far links are from where they were found without encoders on them."""

import numpy as np

from experiments.results.run_log import RunLog
from reporting.style import COLOURS, REFERENCE, Drawing, make_panels, place_legend

_MILLI = 1e3
_SIGMAS = 2.0
_UNITS = {"rad": "mrad", "m": "mm"}


def draw_found_links(log: RunLog) -> Drawing:
    """Errors of the links' positions and of the tool point, beside two standard deviations.

    Args:
        log: With ``q_J``, ``q_J_found``, ``q_J_deviation``, and the same of ``y_t``.
    """
    signal = log["q_J"]
    canvas, panels = make_panels(signal.dim + 1, height=1.15)
    off = _MILLI * (log["q_J_found"].values - signal.values)
    deviation = _SIGMAS * _MILLI * log["q_J_deviation"].values
    for axis, panel in enumerate(panels[:-1]):
        band = deviation[:, axis]
        panel.fill_between(log.time, -band, band, color=REFERENCE, alpha=0.2, linewidth=0.0)
        panel.plot(log.time, off[:, axis], color=COLOURS[axis % len(COLOURS)], label="error")
        panel.set(ylabel=_UNITS.get(signal.unit, "mrad or mm"))
        panel.set_title(f"axis {axis + 1}", fontsize=10)
    tool = _MILLI * np.linalg.norm(log["y_t_found"].values - log["y_t"].values, axis=1)
    band = _SIGMAS * _MILLI * np.linalg.norm(log["y_t_deviation"].values, axis=1)
    panels[-1].fill_between(log.time, 0.0, band, color=REFERENCE, alpha=0.2, linewidth=0.0)
    panels[-1].plot(log.time, tool, color=COLOURS[0])
    panels[-1].set(ylabel="mm")
    panels[-1].set_title("tool point", fontsize=10)
    place_legend(panels[0])
    caption = (
        "Positions of the links as they were found from motors and torques, less the true ones, and"
        " by how far the tool point is off then; grey: within two standard deviations."
    )
    return Drawing("found_links", "Links as found", caption, canvas)
