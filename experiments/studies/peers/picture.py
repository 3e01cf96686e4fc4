"""Deviation, time and the force of a hand, law by law."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.studies.peers.score import Score
from reporting.style import COLOURS, INK, STYLE, WIDTH, Drawing, Figure, render


def draw(found: Mapping[tuple[str, str], Score]) -> Figure:
    """Return the picture of all runs.

    Args:
        found: What runs came to, by law and disturbance.
    """
    laws, disturbances = (list(dict.fromkeys(case[i] for case in found)) for i in (0, 1))
    held = [d for d in disturbances if any(np.isfinite(found[law, d].hand) for law in laws)]
    shown = [d for d in disturbances if d not in held]
    calm = disturbances[0]
    places = np.arange(len(laws))[::-1].astype(float)
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(1.35 * WIDTH, 1.6 + 0.52 * len(laws)))
        wide, narrow, last = canvas.subplots(1, 3, sharey=True, width_ratios=[2.6, 1.0, 1.0])
        height = 0.5 / max(1, len(shown) - 1)
        for k, disturbance in enumerate(shown):
            values = [found[law, disturbance].largest * 1e3 for law in laws]
            lift = 0.25 - height * k
            wide.plot(values, places + lift, "o", color=COLOURS[k], ms=6, label=disturbance)
        wide.set(xscale="log", xlabel="largest distance from the path in mm")
        wide.margins(x=0.03)
        wide.set_yticks(places, laws)
        wide.set_ylim(-0.6, len(laws) - 0.4)
        for line in places[:-1] - 0.5:
            wide.axhline(line, color="#D1D5DB", lw=0.6)
        _bars(narrow, places, [found[law, calm].time for law in laws], "{:.2f}")
        narrow.set_xlabel("time in s")
        for disturbance in held[:1]:
            _bars(last, places, [found[law, disturbance].hand for law in laws], "{:.0f}")
        last.set_xlabel("force of a hand in N")
        handles, labels = wide.get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        caption = (
            "The largest distance from the path under each disturbance; how long the lap takes "
            "without any; the force of a hand of 5 N/mm that goes 20 mm aside at rest. What yields "
            "is meant to leave the path when it is pushed, and needs the least force."
        )
        return render(Drawing("peers", "What one would take instead", caption, canvas))


def _bars(panel: Axes, places: np.ndarray, values: list[float], spelling: str) -> None:
    known = np.nan_to_num(np.array(values))
    panel.barh(places, known, height=0.55, color=COLOURS[0])
    panel.grid(axis="y", visible=False)
    panel.set_xlim(0.0, 1.25 * max(float(known.max()), 1e-9))
    for place, value in zip(places, values, strict=True):
        if np.isfinite(value):
            panel.text(value, place, f" {spelling.format(value)}", va="center", color=INK, size=9)
