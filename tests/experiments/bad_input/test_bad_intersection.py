"""Wrong edges of surfaces through the command line: status 2, a line that says what is allowed."""

import pytest

FLOOR = "!Plane {origin: [0.85, 0, 0.8]}"
BALL = "!Sphere {origin: [0.85, 0, 0.8], radius: 0.1}"


def shape(first, second, more=""):
    return f"path.shape=!Intersection {{surfaces: [{first}, {second}]{more}}}"


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("path.shape=!Intersection {}", ("path.shape.surfaces: none given", "must be 2")),
        (f"path.shape=!Intersection {{surfaces: [{BALL}]}}", ("surfaces = 1 given", "2, e.g.")),
        (shape(FLOOR, "!Line {}"), ("surfaces[1]", "Line")),
        (
            shape(FLOOR, "!Sphere {radius: -1}"),
            ("path.shape.surfaces[1]", "radius = -1", "0.0001 to 10000 m"),
        ),
        (shape(FLOOR, BALL, ", near: [1, 2]"), ("near", "3")),
        (shape(FLOOR, BALL, ", tolerance: 0"), ("tolerance = 0", "1e-09 to")),
        (
            shape(FLOOR, "!Torus {origin: [0.85, 0, 0.8], ring_radius: 0.1, tube_radius: 0.03}"),
            ("path.shape.near: none given", "2 edges", "must be a point"),
        ),
        pytest.param(
            shape(FLOOR, FLOOR),
            ("path.shape.surfaces: coincide around",),
            marks=pytest.mark.slow,
        ),
        (
            shape(
                "!Plane {origin: [0.85, 0, 0.9]}",
                BALL.replace("0.1}", "0.1, axis: [1, 0, 0], start: [0, 1, 0]}"),
            ),
            ("path.shape.surfaces: touch at [0.85, 0, 0.9] m",),
        ),
        (shape("!Plane {}", BALL), ("path.shape.surfaces: do not meet within their bounds",)),
        (shape(FLOOR, "!Fitted {file: none.csv}"), ("none.csv",)),
    ],
)
def test_edges(refused, mine, change, parts):
    refused(mine("vf_edge"), *parts, changes=[change])
