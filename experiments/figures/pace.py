"""Where a reference waits for the drives."""

import numpy as np

from experiments.results.run_log import RunLog
from reporting.style import COLOURS, REFERENCE, Drawing, make_panels, place_legend


def draw_pace(log: RunLog) -> Drawing:
    """Pace of the reference, and what the drives were expected to give and gave."""
    limits = log["tau_d"].limits
    assert limits is not None  # a pace is chosen for limits
    planned, given = (
        np.max(np.abs(log[name].values) / limits, axis=1) for name in ("tau_planned", "tau_d")
    )
    pace = log["pace"].values[:, 0]
    canvas, panels = make_panels(2)
    panels[0].plot(log.time, pace, color=COLOURS[0])
    panels[0].set(ylabel="speed / speed asked for", ylim=(0.0, 1.05), title="Pace")
    panels[1].plot(log.time, given, color=COLOURS[1], label="given")
    panels[1].plot(log.time, planned, "--", color=REFERENCE, label="expected beforehand")
    panels[1].set(ylabel="torque / limit", ylim=(0.0, None), title="Largest share of a drive")
    place_legend(panels[1])
    caption = (
        f"The reference is slowed to {pace.min():.2g} of the speed asked for where a drive would "
        "not have kept up; the largest share of its limit that any drive was expected to give, "
        "and gave."
    )
    return Drawing("pace", "Pace of the reference", caption, canvas)
