"""The drives over time: velocities, torques or forces, friction, deflection, what the law asks.

Rotary drives have joints, velocities in rad/s and torques in Nm; linear ones have slides, m/s and
forces in N. The words follow the units of the signals.
"""

import numpy as np
from matplotlib.axes import Axes

from experiments.figures.forces import shade_pushes
from experiments.results.drives import relative_errors
from experiments.results.run_log import RunLog, Signal
from reporting.style import (
    ALERT,
    BROAD,
    COLOURS,
    REFERENCE,
    Drawing,
    draw_components,
    is_dwarfed,
    largest,
    make_panels,
    place_legend,
    scale_to_late,
    shade,
)

MILLI = 1e3
AT_REST = 0.01  # share of an axis' largest velocity, below which it counts as at rest
PEAK_RATIO = 4.0  # first peak to the rest of the run, from which on the rest is drawn enlarged
_EFFORTS = {"Nm": "torque", "N": "force"}
_EFFORT_TITLES = {"Nm": "torques", "N": "forces"}
MOVERS = {"rad/s": "joint", "m/s": "slide"}
_MILLI_UNITS = {"rad": "mrad", "m": "mm"}
_TITLES = {"eta": "Tangential", "xi": "Transversal", "phi": "Rotational"}
_SYMBOLS = {"eta": r"\eta", "xi": r"\xi", "phi": r"\phi"}
_DWARFED = 4.0  # by how much the start has to be larger than the rest to be cut off


def draw_velocities(log: RunLog) -> Drawing:
    """Velocities of joints or slides and of motors, and their difference where both are logged."""
    signals = {name: log[name] for name in ("v_J", "v_M") if name in log}
    mover = MOVERS.get(signals["v_J"].unit, "joint and slide")
    titles = {
        "v_J": f"{mover.capitalize()} velocities " + r"$\dot q_J$",
        "v_M": r"Motor velocities $\dot q_M$",
    }
    both = len(signals) == 2
    canvas, panels = make_panels(len(signals) + both)
    for panel, (name, signal) in zip(panels, signals.items(), strict=False):
        draw_components(panel, log.time, signal.values, axis_labels(signal.dim))
        for axis in range(signal.dim):
            _draw_limit(panel, signal, axis)
        panel.set(ylabel=f"velocity in {signal.unit}", title=titles[name])
    place_legend(panels[0])
    limited = any(_nears_limit(signals["v_J"], axis) for axis in range(signals["v_J"].dim))
    limits = "; dashed lines are limits within reach" if limited else ""
    if not both:
        title = f"{mover.capitalize()} velocities"
        return Drawing("velocities", title, f"Velocities of the {plural(mover)}{limits}.", canvas)
    difference = log["v_M"].values - log["v_J"].values
    draw_components(panels[2], log.time, difference, axis_labels(difference.shape[1]))
    title = r"Difference $\dot q_M - \dot q_J$"
    panels[2].set(ylabel=f"velocity in {log['v_M'].unit}", title=title)
    caption = "They differ through the elastic transmissions, where the load on them changes"
    title = f"{mover.capitalize()} and motor velocities"
    return Drawing("velocities", title, f"{caption}{limits}.", canvas)


def draw_efforts(log: RunLog) -> Drawing:
    """Drive torques or forces, three axes per panel, with limits near enough to matter (dashed).

    Where a short peak flattens everything else, a second panel shows the rest enlarged.
    """
    signal = log["tau_d"]
    title = f"Drive {_EFFORT_TITLES.get(signal.unit, 'torques and forces')}"
    groups = [range(i, min(i + 3, signal.dim)) for i in range(0, signal.dim, 3)]
    dwarfed = [is_dwarfed(log.time, signal.values[:, group], PEAK_RATIO) for group in groups]
    canvas, panels = make_panels(len(groups) + sum(dwarfed), height=2.6)
    labels = axis_labels(signal.dim)
    places = iter(panels)
    for group, enlarge in zip(groups, dwarfed, strict=True):
        panel = next(places)
        _draw_group(panel, log, group, labels)
        axes = f"axes {group[0] + 1} to {group[-1] + 1}" if len(group) > 1 else labels[group[0]]
        panel.set(ylabel=_effort_label(signal.unit), title=f"{title}, {axes}")
        place_legend(panel)
        if enlarge:
            panel = next(places)
            values = signal.values[:, group]
            for axis in group:
                panel.plot(log.time, signal.values[:, axis], color=COLOURS[axis % len(COLOURS)])
            scale_to_late(panel, log.time, values)
            enlarged = "The same, scaled to the last three quarters"
            panel.set(ylabel=_effort_label(signal.unit), title=enlarged)
    caption = f"{title.removeprefix('Drive ').capitalize()} of the drives"
    limited = any(_nears_limit(signal, axis) for axis in range(signal.dim))
    caption += "; dashed lines are limits within reach." if limited else "."
    name = title.lower().replace(" ", "_")
    return Drawing(name, title, caption, canvas)


def draw_friction(log: RunLog) -> Drawing:
    """Friction of each drive over the velocity that it acts on; both zeros at one height."""
    friction = log["tau_f"]
    motors = "v_M" in log
    velocity = log["v_M" if motors else "v_J"]
    mover = "motor" if motors else MOVERS.get(velocity.unit, "joint or slide")
    word = _EFFORTS.get(friction.unit, "torque or force")
    canvas, panels = make_panels(friction.dim, height=2.0)
    for axis, panel in enumerate(panels):
        v, tau_f = velocity.values[:, axis], friction.values[:, axis]
        right = panel.twinx()
        right.fill_between(log.time, v, color="#9CA3AF", alpha=0.35, linewidth=0.0)
        right.plot(log.time, v, color=REFERENCE, linewidth=1.0)
        right.set(ylabel=f"{mover} velocity\nin {velocity.unit}")
        right.grid(visible=False)
        right.spines["right"].set_visible(True)
        # the twin is drawn above; friction belongs on top
        panel.set_zorder(right.get_zorder() + 1)
        panel.patch.set_visible(False)
        panel.plot(log.time, tau_f, color=COLOURS[1], label=f"friction {word} (left)")
        panel.plot([], [], color=REFERENCE, linewidth=1.0, label=f"{mover} velocity (right)")
        shade(
            [panel],
            log.time,
            np.abs(v) < AT_REST * largest(v),
            "nearly at rest",
            "#FDE9C4",
        )
        for axes, values in ((panel, tau_f), (right, v)):
            span = 1.15 * largest(values)
            if span > 0.0:
                axes.set_ylim(-span, span)
        panel.set(ylabel=_effort_label(friction.unit), title=f"Axis {axis + 1}")
    place_legend(panels[0])
    caption = (
        f"Friction over the velocity that it acts on. Nearly at rest, below {100 * AT_REST:g} % of"
        f" its top speed, a drive sticks: there the friction {word} goes from one sign to the other"
        " without motion."
    )
    return Drawing("friction", "Friction of the drives", caption, canvas)


def draw_deflection(log: RunLog) -> Drawing:
    """Deflection of the elastic joints."""
    canvas, (panel,) = make_panels(1, height=3.2)
    deflection = MILLI * (log["q_M"].values - log["q_J"].values)
    panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
    draw_components(panel, log.time, deflection, axis_labels(deflection.shape[1]))
    unit = _MILLI_UNITS.get(log["q_M"].unit, "mrad or mm")
    panel.set(ylabel=f"deflection in {unit}", title=r"Deflection $q_M - q_J$")
    place_legend(panel)
    caption = "Deflection of the elastic transmissions, motor coordinate less joint coordinate."
    return Drawing("deflection", "Joint deflection", caption, canvas)


def axis_labels(count: int) -> list[str]:
    """Labels ``axis 1`` and so on."""
    return [f"axis {i + 1}" for i in range(count)]


def _effort_label(unit: str) -> str:
    """Label of an axis, in two lines where drives are of both kinds."""
    return f"{_EFFORTS[unit]} in {unit}" if unit in _EFFORTS else f"torque or force\nin {unit}"


def plural(words: str) -> str:
    """``joints and slides`` of ``joint and slide``."""
    return " and ".join(f"{word}s" for word in words.split(" and "))


def _draw_group(panel: Axes, log: RunLog, group: range, labels: list[str]) -> None:
    """The torques or forces of some axes with their limits."""
    signal = log["tau_d"]
    for axis in group:
        colour = COLOURS[axis % len(COLOURS)]
        panel.plot(log.time, signal.values[:, axis], color=colour, label=labels[axis])
        _draw_limit(panel, signal, axis)


def _draw_limit(panel: Axes, signal: Signal, axis: int) -> None:
    """The limit of an axis and its negative, if near enough to matter."""
    if signal.limits is None or not _nears_limit(signal, axis):
        return
    limit = float(signal.limits[axis])
    at_limit = largest(signal.values[:, axis]) >= limit * (1.0 - 1e-9)
    colour = ALERT if at_limit else COLOURS[axis % len(COLOURS)]
    for level in (-limit, limit):
        panel.axhline(level, linestyle="--", color=colour, linewidth=1.0)


def _nears_limit(signal: Signal, axis: int) -> bool:
    """Whether an axis comes within a factor of two of its limit."""
    if signal.limits is None or not np.isfinite(signal.limits[axis]):
        return False
    return largest(signal.values[:, axis]) >= 0.5 * float(signal.limits[axis])


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


def has_virtual_input(log: RunLog) -> bool:
    """Whether there is a virtual input, and a coordinate that it moves."""
    return any(name in log for name in _TITLES)


def draw_virtual_input(log: RunLog) -> Drawing:
    """Virtual input v of the law (Fig. 3.6 c, 4.4 c), a panel for each kind of coordinates.

    Args:
        log: With ``virtual_input``, whose labels are those of the coordinates after ``v_``.
    """
    signal = log["virtual_input"]
    kinds = [name for name in _TITLES if name in log]
    canvas, panels = make_panels(len(kinds), height=2.1)
    for kind, panel in zip(kinds, panels, strict=True):
        columns = [signal.labels.index(f"v_{label}") for label in log[kind].labels]
        values = signal.values[:, columns]
        labels = [_symbol(kind, label) for label in log[kind].labels]
        panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
        draw_components(panel, log.time, values, labels)
        title = _TITLES[kind]
        if is_dwarfed(log.time, values, _DWARFED):
            scale_to_late(panel, log.time, values)
            title += ", scaled to the last three quarters"
        unit = _written(signal.unit, log[kind].unit)
        panel.set(ylabel=f"$v$ in {unit}", title=title)
    shade_pushes(panels, log)
    for panel in panels:
        place_legend(panel)
    order = signal.unit.rpartition("^")[2]
    word = {"1": "first", "2": "second", "3": "third", "4": "fourth"}[order]
    caption = (
        f"What the law asks of the {word} time derivatives of the coordinates: that of the"
        " reference, less what errors and their integrals are fed back with."
    )
    return Drawing("virtual_input", "Virtual input of the law", caption, canvas)


def _symbol(kind: str, label: str) -> str:
    """Symbol of a component, of a coordinate like ``xi_1``."""
    return f"$v_{{{_SYMBOLS[kind]}{label.removeprefix(kind)}}}$"


def _written(unit: str, coordinate: str) -> str:
    """Unit of a derivative, ``SI/s^2``, in that of its coordinate, for an axis."""
    base, _, order = unit.replace("SI", coordinate).partition("^")
    return base if order == "1" else f"{base}$^{order}$"


_SMALLEST_SPAN = 2.0  # %, of the axis of relative errors
_TOGETHER = 3  # axes whose momenta share a panel


def draw_friction_estimate(log: RunLog) -> Drawing:
    """Friction of each drive, and what the controller takes it for."""
    friction, estimate = log["tau_f"], log["friction_estimate"]
    word = {"Nm": "torque in Nm", "N": "force in N"}.get(friction.unit, "torque or force")
    canvas, panels = make_panels(friction.dim, height=1.9)
    for axis, panel in enumerate(panels):
        panel.plot(log.time, friction.values[:, axis], label="true", **BROAD)
        panel.plot(log.time, estimate.values[:, axis], color=COLOURS[1], label="estimate")
        span = 1.4 * float(np.max(np.abs(friction.values[:, axis]), initial=0.0))
        if span > 0.0:
            panel.set_ylim(-span, span)
        panel.set(ylabel=word, title=f"Axis {axis + 1}")
    place_legend(panels[0])
    caption = "What the controller takes for friction of the drives, and what it is."
    return Drawing("friction_estimate", "Estimated friction", caption, canvas)


def draw_friction_coefficients(log: RunLog) -> Drawing:
    """Momenta, and the coefficients estimated from them in units of the true ones (Fig. A.1)."""
    momentum = log["momentum"]
    shares = _shares(momentum.dim)
    canvas, panels = make_panels(len(shares) + 2, height=2.4)
    for panel, axes in zip(panels, shares, strict=False):
        for axis in axes:
            label = rf"$p_{axis + 1}$"
            panel.plot(log.time, momentum.values[:, axis], color=_colour(axis), label=label)
        title = "Generalized momenta $p$" if axes[0] == 0 else "Those of the last axes"
        panel.set(ylabel=f"momentum in {momentum.unit}", title=title)
        place_legend(panel)
    kinds = {"f_c": "Coulomb friction $f_c$", "f_v": "Viscous friction $f_v$"}
    for panel, (name, title) in zip(panels[-2:], kinds.items(), strict=True):
        values = 100.0 * (1.0 + relative_errors(log, name))
        labels = [f"axis {i + 1}" for i in range(values.shape[1])]
        panel.axhline(100.0, color=REFERENCE, linewidth=0.8)
        panel.axhspan(98.0, 102.0, color=REFERENCE, alpha=0.15, linewidth=0.0)
        draw_components(panel, log.time, values, labels)
        late = values[log.time >= log.time[-1] / 10.0] - 100.0
        span = max(1.1 * float(np.nanmax(np.abs(late), initial=0.0)), _SMALLEST_SPAN)
        panel.set_ylim(100.0 - span, 100.0 + span)
        panel.set(ylabel="estimate in %\nof the true one", title=title)
    place_legend(panels[-2])
    caption = (
        "Momenta on which friction acts, from which it is estimated, and the estimated coefficients"
        " in units of the true ones; the band is 2 % wide to either side."
    )
    return Drawing("friction_coefficients", "Estimated coefficients of friction", caption, canvas)


def _shares(axes: int) -> list[range]:
    """Axes of each panel of momenta: those next to the tool have too little to be seen."""
    half = (axes + 1) // 2
    return [range(axes)] if axes <= _TOGETHER else [range(half), range(half, axes)]


def _colour(axis: int) -> str:
    return COLOURS[axis % len(COLOURS)]
