"""The virtual input: what the law asks of the coordinates, once they are linearized."""

from experiments.figures.forces import shade_pushes
from experiments.results.run_log import RunLog
from reporting.style import (
    REFERENCE,
    Drawing,
    draw_components,
    is_dwarfed,
    make_panels,
    place_legend,
    scale_to_late,
)

_TITLES = {"eta": "Tangential", "xi": "Transversal", "phi": "Rotational"}
_SYMBOLS = {"eta": r"\eta", "xi": r"\xi", "phi": r"\phi"}
_DWARFED = 4.0  # by how much the start has to be larger than the rest to be cut off


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
