"""Shades of a panel, as :func:`reporting.style.shade` draws them."""

from matplotlib.collections import PolyCollection


def shades(panel):
    """Return the shades of a panel, one for each reason."""
    return [shown for shown in panel.collections if isinstance(shown, PolyCollection)]


def spans(panel, label=None):
    """Return begin and end of what is shaded, for one reason or for all of them."""
    return [
        (path.vertices[:, 0].min(), path.vertices[:, 0].max())
        for shown in shades(panel)
        if label in (None, shown.get_label())
        for path in shown.get_paths()
    ]
