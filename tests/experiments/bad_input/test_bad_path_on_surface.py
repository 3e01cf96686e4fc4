"""Wrong paths on surfaces through the command line: status 2, a line that says what is allowed."""

import pytest

NAME = "pfc_on_surface_6r"


def shape(said):
    return f"path.shape=!OnSurface {{{said}}}"


@pytest.fixture(name="wrong")
def fixture_wrong(refused, mine):
    """Return a function that runs the copied scenario with changes and checks the refusal."""
    return lambda *parts, changes, file=None: refused(
        mine(NAME), *parts, changes=changes, file=file
    )


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("surface=null", ("!OnSurface", "no surface", "write surface:")),
        (shape(""), ("neither of thetas and file",)),
        (shape("thetas: [[0, 0], [0.1, 0]], file: a.csv"), ("both of thetas and file",)),
        (shape("thetas: [[0, 0], [0.1]]"), ("thetas[1]", "2 finite numbers")),
        (shape("thetas: [[0, 0], [.nan, 0]]"), ("thetas[1][0]", "expected a number")),
        (shape("thetas: [[0, 0]]"), ("path.shape", "2 or more pairs")),
        (shape("thetas: [[0, 0], [0.1, 0]], closed: true"), ("3 or more pairs",)),
        (shape("thetas: [[0, 0], [0, 0], [0.1, 0]]"), ("coincide",)),
        (shape("thetas: [[0, 0], [0.3, 0]]"), ("path.shape", "theta_1: 0.3", "[-0.25, 0.25]")),
        (
            # a parabola beyond its waypoints
            shape("thetas: [[-0.24, -0.3], [-0.24, 0.3], [0.24, 0]]"),
            ("path.shape", "theta_1", "the surface is defined on"),
        ),
        (shape("thetas: [[0, 0], [0.1, 0]], max_distance: 0"), ("max_distance",)),
        (shape("file: none.csv"), ("none.csv",)),
        ("path.orientation.task=none", ("path.orientation", "surface.orientation")),
        ("path.orientation.keyframes=[{angles_deg: [0, 0, 0]}]", ("surface.orientation",)),
        ("surface.shape.first=[0.2, 0.1]", ("first",)),
    ],
)
def test_refused(wrong, change, parts):
    wrong(*parts, changes=[change], file="none.csv" if "none.csv" in change else None)


def test_beyond_the_end_of_an_open_path(wrong):
    changes = [shape("thetas: [[0, 0], [0.1, 0]]"), "reference.points=[-0.1, 0.2]"]
    wrong("reference.points", "the path is open", changes=changes)


def test_too_few_joints(wrong):
    held = "robot.fixed_joints={joint_5: 0, joint_6: 0}"
    changes = ["robot.model=comau_racer_1_4", "start.posture_deg=[0, 105, -40, 0]", held]
    changes += ["controller.law=rigid"]
    wrong("4 joints for 6 outputs", "tool_axis", changes=changes)


def test_points_far_from_the_surface(wrong, tmp_path):
    rows = [[0.85, 0.1 * k, 0.95 + 0.005 * k**2 + (k == 2) * 2e-3] for k in range(4)]
    lines = ["x,y,z", *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "points.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    wrong("path.shape", "waypoint 3", "at most 1 mm", changes=[shape("file: points.csv")])
