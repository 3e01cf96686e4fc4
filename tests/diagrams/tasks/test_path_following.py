"""Reference motion of a scenario along a path."""

from pathlib import Path

import pytest

from diagrams.scenario import (
    Circle,
    ControllerParameters,
    Line,
    PathParameters,
    ReferenceParameters,
    Scenario,
)
from diagrams.scenario_task import make_task
from pfsc_drake.errors import InputError

LINE = Line([0.8, 0.0, 1.0], [0.8, 0.3, 1.0])


def places(shape, points):
    """Arc lengths at which the reference rests at first and at last [m]."""
    settings = Scenario(
        path=PathParameters(shape),
        controller=ControllerParameters(law="rigid"),
        reference=ReferenceParameters(points),
    )
    task = make_task(settings, Path())
    motion = task.motion
    ends = motion.derivatives([*motion.domain], 0)[:, 0, 0]
    return ends.tolist(), motion.domain[1]


@pytest.mark.parametrize(
    ("shape", "length"), [(LINE, 0.3), (Circle(radius=0.1), 0.2 * 3.141592653589793)]
)
def test_the_end_of_a_path_is_its_length(shape, length):
    ends, duration = places(shape, [0.0, "end"])
    assert ends == pytest.approx([0.0, length], abs=1e-9)
    assert duration == places(shape, [0.0, ends[1]])[1]
    assert places(shape, ["end", 0.1])[0] == pytest.approx([length, 0.1], abs=1e-9)


def test_there_and_back():
    ends, duration = places(LINE, [0.0, "end", 0.0])
    assert ends == pytest.approx([0.0, 0.0], abs=1e-12)
    assert duration == pytest.approx(places(LINE, [0.0, 0.3, 0.0])[1], rel=1e-12)


def test_points_beside_the_path():
    with pytest.raises(InputError, match=r"reference\.points: 0\.4 m; the path is open and 0\.3 m"):
        places(LINE, ["end", 0.4])


def test_a_surface_has_no_end():
    assert ReferenceParameters([0.0, 0.2]).arc_lengths(None) == [0.0, 0.2]
    with pytest.raises(InputError, match=r"reference\.points = .*'end'.*a surface has no end"):
        ReferenceParameters([0.0, "end"]).arc_lengths(None)
