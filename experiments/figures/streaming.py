"""What became of way points that came while the tool moved."""

from experiments.results.run_log import RunLog
from pfsc_drake.control.streams.messages import StreamStatus
from reporting.style import COLOURS, REFERENCE, Drawing, make_panels, place_legend, shade

_MM = 1e3


def draw_stream(log: RunLog) -> Drawing:
    """Speed with what bends allow, the way left, and way points, over time.

    Args:
        log: With ``way_left``, ``bend_speed``, ``way_points``, ``stream_status``.
    """
    canvas, (speed, left, points) = make_panels(3, height=2.0)
    speed.plot(log.time, log["eta_dot"].values, color=COLOURS[0], label="tool")
    limit = log["bend_speed"].values
    speed.plot(log.time, limit, "--", color=REFERENCE, label="bends allow")
    speed.set(ylabel="m/s", title="Speed along the path")
    way = log["way_left"].values[:, 0]
    left.plot(log.time, _MM * way, color=COLOURS[1])
    left.axhline(0.0, color=REFERENCE, linewidth=0.8)
    left.set(ylabel="mm", title="Way left that is known")
    points.step(log.time, log["way_points"].values[:, 0], where="post", color=COLOURS[2])
    ends = log["stream_status"].values[:, 0] >= StreamStatus.ENDING
    shade([speed, left, points], log.time, ends, "goes to the last one, to rest", "#E5E7EB")
    points.set(ylabel="way points", xlabel="t in s", title="Way points taken")
    place_legend(speed)
    caption = (
        "Speed of the tool along its path, and what bends allow where it is; how far the path is "
        "known ahead of it; how many way points have been taken."
    )
    return Drawing("stream", "Way points on the fly", caption, canvas)
