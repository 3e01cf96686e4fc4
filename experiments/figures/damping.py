"""Damping along a path that depends on where the tool is."""

import numpy as np

from experiments.results.run_log import RunLog
from reporting.style import COLOURS, Drawing, make_panels


def has_varying_damping(log: RunLog) -> bool:
    """Whether the log has a damping along a path that varies."""
    if "damping" not in log or "eta" not in log:
        return False
    return bool(np.ptp(log["damping"].values[:, 0]) > 0.0)


def draw_damping(log: RunLog) -> Drawing:
    """Damping of the tangential coordinate over the arc length, wherever the tool was."""
    eta, damping = log["eta"].values[:, 0], log["damping"].values[:, 0]
    order = np.argsort(eta)
    canvas, (panel,) = make_panels(1, height=2.6, common_time=False)
    panel.plot(eta[order], 1e-3 * damping[order], color=COLOURS[0])
    panel.set(xlabel=r"$\eta$ in m", ylabel="damping in kNs/m", ylim=(0.0, None))
    panel.set_title(r"Damping $d_\parallel$ over the arc length")
    caption = (
        f"Damping of the impedance along the path where the tool was, {damping.min():.3g} to "
        f"{damping.max():.4g} Ns/m."
    )
    return Drawing("damping", "Damping along the path", caption, canvas)
