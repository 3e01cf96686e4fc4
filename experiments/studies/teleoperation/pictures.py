"""Pictures of couplings over a channel: what is felt, a wall, energy."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.studies.teleoperation.point import PERIOD, Motion
from experiments.studies.teleoperation.sequences import Energy
from experiments.studies.teleoperation.transparency import FREQUENCY, WALL, Felt
from reporting.style import COLOURS, INK, Drawing, make_panels, place_legend

_LEAST = 1e-3  # J, that is shown of an excess


def draw_felt(
    delays: Sequence[float],
    felt: Mapping[str, Sequence[Felt]],
    theory: tuple[np.ndarray, np.ndarray],
) -> Drawing:
    """What a hand feels of free motion and of a rigid wall, over the delay.

    Args:
        delays: Of the channel, each way [s].
        felt: By coupling, at each delay.
        theory: Impedance [N s/m] and stiffness [N/m] of waves at each delay.
    """
    canvas, (free, wall, apart) = make_panels(3, common_time=False)
    late = 1e3 * np.array(delays)
    for (name, rows), colour in zip(felt.items(), COLOURS, strict=False):
        style: dict[str, Any] = {"color": colour, "marker": "o", "markersize": 4}
        style["linestyle"] = _line(name)
        steady = [np.nan if np.isnan(row.stiffness) else row.impedance for row in rows]
        free.plot(late, steady, label=name, **style)
        wall.plot(late, [row.stiffness for row in rows], label=name, **style)
        apart.plot(
            late,
            [np.nan if np.isnan(r.stiffness) else 1e3 * r.apart for r in rows],
            label=name,
            **style,
        )
    for panel, values in zip((free, wall), theory, strict=True):
        panel.plot(late, values, "--", color=INK, linewidth=1.0, label="waves, theory")
        panel.set(yscale="log")
    free.set(title=f"Impedance in free motion, {FREQUENCY:g} Hz", ylabel="in N s/m")
    wall.set(title="Stiffness of a rigid wall", ylabel="in N/m")
    apart.set(
        title="Between leader and follower in free motion",
        ylabel="at most, in mm",
        xlabel="delay each way in ms",
    )
    for panel in (free, wall):
        place_legend(panel)
    caption = (
        "Points: measured at the handle; none where the force at the wall does not come to rest, "
        "as with position and force from 25 ms on. The longer the delay, the softer a wall may "
        "be: with waves it is b by the delay."
    )
    return Drawing("transparency", "What a hand feels, over the delay", caption, canvas)


def _line(name: str) -> str:
    """Return how a coupling is drawn; one that is made passive may lie upon the one that is not."""
    return ":" if name.endswith(", passive") else "-"


def draw_contact(contact: Mapping[str, Motion], delay: float) -> Drawing:
    """A hand that presses a point against a wall far away.

    Args:
        contact: By coupling.
        delay: Of the channel, each way [s].
    """
    canvas, (leader, point, force) = make_panels(3)
    for (name, motion), colour in zip(contact.items(), COLOURS, strict=False):
        time = np.arange(len(motion.hand)) * PERIOD
        style: dict[str, Any] = {"color": colour, "linestyle": _line(name)}
        leader.plot(time, 1e3 * motion.handle[:, 0], label=name, **style)
        point.plot(time, 1e3 * motion.point[:, 0], **style)
        force.plot(time, -motion.motor[:, 0], **style)
    for panel in (leader, point):
        panel.axhline(1e3 * WALL, color=INK, linestyle="--", linewidth=0.9)
    leader.set(title="Leader", ylabel="way in mm")
    point.set(title="Follower, which the wall holds (dashed)", ylabel="way in mm")
    force.set(title="Force that the hand feels", ylabel="force in N")
    place_legend(leader)
    caption = (
        f"A hand leads the follower to a wall over {1e3 * delay:g} ms each way, presses, and from "
        "5 s on presses more."
    )
    return Drawing("contact", "Contact from afar", caption, canvas)


def draw_energies(energies: Mapping[str, Sequence[Energy]]) -> Drawing:
    """What couplings gave at most beyond what they had, sorted.

    Args:
        energies: Of random runs by coupling.
    """
    canvas, (panel,) = make_panels(1, height=3.2, common_time=False)
    for (name, runs), colour in zip(energies.items(), COLOURS, strict=False):
        excess = np.sort([-run.coupling for run in runs])
        share = (np.arange(len(runs)) + 0.5) / len(runs)
        dashed = "--" if max(excess) <= 0.0 else "-"
        panel.plot(np.maximum(excess, _LEAST), share, dashed, color=colour, label=name)
    panel.set(xscale="log", ylim=(-0.02, 1.02), ylabel="share of the runs")
    panel.set(xlabel=f"given beyond the tanks' content, at most, in J ({_LEAST:g}: never)")
    panel.set_title("Energy that the coupling gave and had not got")
    panel.legend(loc="lower right")
    caption = (
        "Share of random runs in which a coupling gave no more than so much beyond the content of "
        "its tanks. Those that are made passive stay at the left end, whatever the channel does."
    )
    return Drawing("energy", "Energy in random sequences", caption, canvas)
