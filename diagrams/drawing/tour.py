"""A recording that is explained: stages with a caption, each seen from where it shows best."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_TEMPLATE = Path(__file__).resolve().parent / "tour.html"
_END = "</body>"


@dataclass(frozen=True, eq=False)
class Stage:
    """A part of a recording.

    Attributes:
        time: When it begins [s].
        name: One word, on the button that leads there.
        text: What happens, one sentence.
        camera: Where the camera stands [m], shape (3,); where it was at first if not given.
        target: Where it looks [m], shape (3,), given with the camera.
    """

    time: float
    name: str
    text: str
    camera: np.ndarray | None = None
    target: np.ndarray | None = None


def explained(page: str, stages: Sequence[Stage]) -> str:
    """Return the page of a recording with captions, and a camera that goes from stage to stage.

    Whoever turns the view keeps it, until the camera is let go of again.

    Args:
        page: From :func:`diagrams.drawing.replay.record`.
        stages: In the order of their times; without any the page stays as it is.
    """
    if not stages:
        return page
    told = [
        {
            "time": stage.time,
            "name": stage.name,
            "text": stage.text,
            "camera": _place(stage.camera),
            "target": _place(stage.target),
        }
        for stage in stages
    ]
    # inside of a script nothing may look like its end
    data = json.dumps(told).replace("<", "\\u003c")
    added = _TEMPLATE.read_text(encoding="utf-8").replace("STAGES", data)
    before, end, after = page.rpartition(_END)
    return before + added + end + after


def _place(point: np.ndarray | None) -> list[float] | None:
    return None if point is None else [round(float(x), 6) for x in point]
