"""Figures of a tool that is led from afar: where it follows, what is felt, where energy is."""

import numpy as np
from matplotlib.axes import Axes

from experiments.results.run_log import RunLog
from experiments.results.teleoperation import stored_in_channel, turns_between, works
from reporting.style import COLOURS, INK, Drawing, make_panels, place_legend

_AXES = ("x", "y", "z")


def draw_teleoperation(log: RunLog) -> Drawing:
    """Where the leader has the tool and where that is, and what both sides feel."""
    canvas, (way, apart, force) = make_panels(3)
    led, tool = log["led_point"].values, log["y_t"].values
    _plot_axes(way, log.time, tool - tool[0], led - led[0])
    way.set(title="Way of the tool, and of the leader (dashed)", ylabel="way in m")
    distance = np.linalg.norm((led - led[0]) - (tool - tool[0]), axis=1)
    apart.plot(log.time, 1e3 * distance, color=COLOURS[0])
    apart.set(title="Between where the leader is and the tool", ylabel="distance in mm")
    _plot_sizes(force, log, "force", "that leads the tool")
    force.set(title="Forces", ylabel="force in N")
    place_legend(way)
    place_legend(force)
    caption = (
        "Ways since the start in the follower's lengths. A force at rest holds the leader off by "
        "the force times the delay, by the impedance of the waves."
    )
    return Drawing("teleoperation", "Led from afar", caption, canvas)


def draw_led_turns(log: RunLog) -> Drawing:
    """How the leader has the tool turned and how it is, and the moments that both sides feel."""
    canvas, (turn, apart, moment) = make_panels(3)
    led, tool = (log[name].values.reshape(-1, 3, 3) for name in ("led_orientation", "R_e"))
    turned = [turns_between(np.broadcast_to(R[:1], R.shape), R) for R in (tool, led)]
    _plot_axes(turn, log.time, *turned)
    turn.set(title="Turn of the tool, and of the leader (dashed)", ylabel="turn in rad")
    angle = np.linalg.norm(turns_between(tool, led), axis=1)
    apart.plot(log.time, 1e3 * angle, color=COLOURS[0])
    apart.set(title="Between how the leader is turned and the tool", ylabel="angle in mrad")
    _plot_sizes(moment, log, "moment", "that turns the tool")
    moment.set(title="Moments", ylabel="moment in Nm")
    place_legend(turn)
    place_legend(moment)
    caption = "Turns since the start, axis times angle, along the world's axes."
    return Drawing("led_turns", "Turned from afar", caption, canvas)


def _plot_axes(panel: Axes, time: np.ndarray, tool: np.ndarray, led: np.ndarray) -> None:
    """Plot what the tool does along each axis, and dashed what the leader asks for."""
    for k, axis in enumerate(_AXES):
        panel.plot(time, tool[:, k], color=COLOURS[k], label=axis)
        panel.plot(time, led[:, k], "--", color=COLOURS[k], linewidth=0.9)


def _plot_sizes(panel: Axes, log: RunLog, kind: str, given: str) -> None:
    """Plot how large forces or moments are at both sides."""
    felt = np.linalg.norm(log[f"leader_{kind}"].values, axis=1)
    at_tool = np.linalg.norm(log[f"port_{kind}"].values[:, 3:], axis=1)
    panel.plot(log.time, felt, color=COLOURS[1], label="that the hand feels")
    panel.plot(log.time, at_tool, color=INK, linewidth=0.9, label=given)


def draw_port_energy(log: RunLog) -> Drawing:
    """Work of both ports, and the energy in channel and tanks."""
    canvas, (work, stored, share) = make_panels(3)
    done = -works(log)
    work.plot(log.time, done[:, 0], color=COLOURS[0], label="taken from the hand")
    work.plot(log.time, -done[:, 1], color=COLOURS[1], label="given to the follower")
    bound = float(log["port_tank"].values[0].sum())
    total = done.sum(axis=1)
    work.plot(log.time, total, color=INK, label="taken less given")
    work.axhline(-bound, color=INK, linestyle="--", linewidth=0.9, label="never below")
    work.set(title="Work of the coupling's forces", ylabel="work in J")
    tank, under_way = log["port_tank"].values, stored_in_channel(log)
    for k, name in enumerate(("leader", "follower")):
        stored.plot(log.time, tank[:, k], color=COLOURS[k], label=f"tank of the {name}")
        stored.plot(
            log.time, under_way[:, k], ":", color=COLOURS[k], label=f"under way from the {name}"
        )
    stored.set(title="Energy that is stored", ylabel="energy in J")
    for k, name in enumerate(("leader", "follower")):
        share.plot(log.time, log["port_share"].values[:, k], color=COLOURS[k], label=name)
    share.set(title="Share of force and wave that could be paid", ylabel="share", ylim=(0, 1.05))
    for panel in (work, stored, share):
        place_legend(panel)
    caption = (
        "What the coupling takes from the hand, less what it gives to the follower, lies in tanks "
        "and channel or is lost; it never gives more than was in the tanks at the start."
    )
    return Drawing("port_energy", "Energy of the teleoperation", caption, canvas)
