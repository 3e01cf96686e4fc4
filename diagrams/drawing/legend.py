"""Legend of a recording: the colours of its lines, axes, surfaces and arrows."""

from html import escape

from pydrake.geometry import Rgba

from diagrams.drawing.recorded import RecordedMotion
from diagrams.tasks.drawing import AXIS, ManifoldDrawing
from pfsc_drake.systems.drawing.manifold_visualizer import signed_color
from pfsc_drake.systems.drawing.obstacle_visualizer import MARGIN_COLOR, OBSTACLE_COLOR
from pfsc_drake.systems.drawing.tool_visualizer import FORCE_COLOR

TOOL_COLOR, ELBOW_COLOR = Rgba(0.9, 0.25, 0.1, 1.0), Rgba(0.45, 0.2, 0.75, 1.0)
# a report shows the recording in a lower frame, with a legend of its own
_STYLE = """<style>
#legend { position: fixed; left: 12px; bottom: 12px; margin: 0; padding: 8px 12px; list-style: none;
  background: rgb(255 255 255 / 85%); border-radius: 8px; font: 13px/1.5 system-ui, sans-serif;
  pointer-events: none; }
#legend i { display: inline-block; width: 20px; height: 4px; margin-right: 7px;
  vertical-align: 3px; }
@media (max-height: 640px) { #legend { display: none; } }
</style>"""
_TRAIL = "trace of the tool point"


def recording_legend(manifold: ManifoldDrawing, motion: RecordedMotion) -> dict[str, str]:
    """Return the colours of a recording, each ``#rrggbb``, by the description of what has it.

    Args:
        manifold: Drawing of the path, surface or regions.
        motion: The recorded motion.
    """
    entries = manifold.legend()
    if motion.distance is None:
        entries[_TRAIL] = TOOL_COLOR
    else:
        for side, value in (("above", 1.0), ("on", 0.0), ("below", -1.0)):
            entries[f"{_TRAIL}, {side} the surface"] = signed_color(value, 1.0)
    if motion.tool_force is not None:
        entries["arrow: force on the tool"] = FORCE_COLOR
    if motion.pushes is not None:
        entries["arrow: force of a hand"] = FORCE_COLOR
    if motion.elbow is not None:
        entries["trace of a point of the arm"] = ELBOW_COLOR
    if motion.obstacles is not None:
        entries["obstacle"] = OBSTACLE_COLOR
        entries["its safety distance"] = MARGIN_COLOR
    lines_first = sorted(entries.items(), key=lambda entry: entry[0].startswith(AXIS))
    return {text: css_color(color) for text, color in lines_first}


def css_color(color: Rgba) -> str:
    """Return a colour as ``#rrggbb``, without its opacity."""
    levels = (round(255.0 * level) for level in (color.r(), color.g(), color.b()))
    return "#" + "".join(f"{level:02x}" for level in levels)


def with_legend(recording: str, legend: dict[str, str]) -> str:
    """Return the page of a recording with its legend, which is hidden in low frames.

    Args:
        recording: Page of Meshcat.
        legend: From :func:`recording_legend`.
    """
    entries = "".join(
        f'<li><i style="background: {color}"></i>{escape(text)}</li>'
        for text, color in legend.items()
    )
    body, end, rest = recording.rpartition("</body>")
    return f'{body}{_STYLE}\n<ul id="legend">{entries}</ul>\n{end}{rest}'
