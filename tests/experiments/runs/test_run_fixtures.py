"""Guidance within forbidden regions (Sec. 5.1.1, 5.2.4), through the command line, shortened."""

import json

import h5py
import numpy as np
import pytest

from experiments.cli import main

# (time, place) of the hand along the segments A to G, in a third of the time
WAY = [
    (0.6, [1.094, 0.02, 1.077]),
    (1.5, [0.97, 0.02, 0.84]),
    (2.4, [0.92, 0.06, 0.79]),
    (3.3, [0.85, 0.25, 0.85]),
    (4.2, [0.75, 0.25, 0.66]),
    (5.1, [0.65, 0.0, 0.66]),
    (5.9, [0.85, 0.0, 0.66]),
    (6.7, [0.85, 0.0, 0.85]),
]
FREE, SURFACE, EDGE = 0, 1, 2
CYLINDER, FLOOR, CEILING, PARABOLOID = range(4)


def run(folder, scenario, duration, *changes, status=0):
    arguments = ["run", scenario, "--out", str(folder), "--duration", str(duration)]
    changes = [text for change in changes for text in ("--set", change)]
    assert main([*arguments, "--no-figures", "--no-recording", *changes]) == status
    with h5py.File(folder / "log.h5") as file:
        log = {name: dataset[:] for name, dataset in file.items()}
        log["mode_names"] = list(file["mode"].attrs["labels"])
    metrics = json.loads((folder / "metrics.json").read_text())
    return log, {name: metric["value"] for name, metric in metrics.items()}


def way(points):
    places = ", ".join(f"{{time: {t}, position: {p}}}" for t, p in points)
    return f"hand.waypoints=[{places}]"


def _to_polyline(points, place):
    """Distance of a place from a line through points."""
    begin, way = points[:-1], np.diff(points, axis=0)
    share = np.sum((place - begin) * way, axis=1) / np.sum(way**2, axis=1)
    feet = begin + np.clip(share, 0.0, 1.0)[:, None] * way
    return np.linalg.norm(feet - place, axis=1).min()


def to_paraboloid(y):
    """Signed distance from z = 0.9 - r^2 c, by a search over its profile."""
    c = 34.626
    r = np.hypot(y[:, 0] - 0.95, y[:, 1])
    radii = np.linspace(0.0, 0.12, 2001)
    heights = 0.9 - c * radii**2
    distance = np.array(
        [
            _to_polyline(np.stack([radii, heights], axis=1), np.array(place))
            for place in zip(r, y[:, 2], strict=True)
        ]
    )
    return np.where(y[:, 2] > 0.9 - c * r**2, distance, -distance)


@pytest.mark.slow
def test_the_segments_of_the_dissertation_at_three_times_its_speed(tmp_path):
    """The tool's true place against closed forms of the surfaces, and the sequence of modes."""
    log, metrics = run(tmp_path, "vf_forbidden_region", 7.2, way(WAY), "hand.release=7")
    y = log["y_t"]
    assert np.linalg.norm(log["velocity_command"], axis=1).max() > 0.45
    inside = {
        CYLINDER: 0.2 - np.hypot(y[:, 0] - 0.9, y[:, 1]),
        FLOOR: y[:, 2] - 0.7,
        CEILING: 1.1 - y[:, 2],
    }
    for region, h in inside.items():
        assert h.min() > -0.2e-3
        np.testing.assert_allclose(log["region_distance"][:, region], h, atol=1e-9)
    h = to_paraboloid(y[::10])
    assert h.min() > -0.2e-3
    np.testing.assert_allclose(log["region_distance"][::10, PARABOLOID], h, atol=1e-7)
    assert log["mode_names"] == ["free", "surface", "edge", "corner"]
    mode = log["mode"][:, 0]
    changes = [int(mode[0]), *mode[1:][np.diff(mode) != 0].astype(int)]
    # A, B, C, D, E, F, G
    assert changes == [FREE, SURFACE, FREE, SURFACE, EDGE, SURFACE, FREE]
    held = log["region_labels"].astype(bool)
    assert held[mode == EDGE][:, [CYLINDER, FLOOR]].all()
    assert metrics["audit_missed"] == 0.0
    assert metrics["audit_stationarity"] < 1e-9
    assert metrics["audit_allowance"] < 1e-9
    assert metrics["audit_energy"] < 1e-9
    assert metrics["audit_tank"] < 1e-9
    assert metrics["audit_bound"] > 0.0


@pytest.mark.slow
def test_an_acute_edge_holds_the_tool(tmp_path):
    pull = way([(0.6, [0.95, 0.08, 0.84]), (1.6, [0.77, 0.08, 0.80]), (2.4, [0.76, 0.04, 0.9])])
    log, _ = run(tmp_path, "vf_wedge", 2.9, pull, "hand.release=3")
    assert log["region_distance"].min() > -0.2e-3


@pytest.mark.slow
def test_a_ball_that_swings_takes_the_tool_along(tmp_path):
    """The tool's true place against that of the ball at the time, which its clock tells."""
    log, metrics = run(tmp_path, "vf_moving_region", 4.5)
    t, y, clock = log["t"], log["y_t"], log["region_clock"][:, 0]
    np.testing.assert_allclose(np.diff(clock), 1e-3, atol=1e-12)  # it never has to wait
    # full swing from 1 s of ramp after its begin on
    late = t > 2.2
    ball = np.tile([0.9, 0.0, 0.88], (late.sum(), 1))
    ball[:, 1] += 0.064 * np.sin(2 * np.pi * 0.25 * (t[late] - 1.0))
    h = np.linalg.norm(y[late] - ball, axis=1) - 0.06
    assert h.min() > -0.2e-3
    np.testing.assert_allclose(log["region_distance"][late, 3], h, atol=1e-6)
    assert np.abs(h[(t[late] > 2.3) & (t[late] < 3.0)]).max() < 0.3e-3
    assert metrics["audit_tank"] < 1e-9
    assert metrics["audit_bound"] > 0.0


@pytest.mark.slow
def test_a_soft_region_yields_like_its_spring(tmp_path):
    lean = way([(0.6, [0.95, 0.0, 0.93]), (1.2, [0.95, 0.0, 0.88]), (2.5, [0.95, 0.0, 0.88])])
    soft = "fixtures.regions=[{shape: {origin: [0.95, 0, 0.9]}, stiffness: 3000}]"
    changes = [lean, soft, "start.position=[0.95, 0, 0.93]", "hand.tremor=0"]
    log, metrics = run(tmp_path, "vf_soft_region", 2.6, *changes)
    late = log["t"] > 2.3
    depth = 0.9 - log["y_t"][late, 2].mean()
    pressing = -log["wrench_ext"][late, 2].mean()
    assert depth > 2e-3
    assert depth == pytest.approx(pressing / 3000.0, rel=0.05)
    assert metrics["deepest_in_soft"] >= depth - 1e-4
    assert metrics["audit_energy"] < 1e-9
    assert metrics["audit_tank"] < 1e-9


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["start.position=[0.95, 0, 0.8]"], "is in a forbidden region"),
        (["start.position=[]"], "start.position"),
        (["compliance.tangential.stiffness.value=100"], "compliance.tangential"),
        (["fixtures.guidance.approach_time=0"], "approach_time = 0.0; allowed: a positive number"),
        (["fixtures.guidance.tank.initial=2"], "fixtures.guidance.tank.initial = 2"),
        (["fixtures.servo_lag=1"], "servo_lag = 1.0; allowed: below 0.1 s"),
        (
            ["fixtures.distance_evaluations=1"],
            "distance_evaluations = 1; allowed: 0, or 2 and more",
        ),
        (["fixtures.regions=[{admissible: inside}]"], "fixtures.regions[0]"),
        (["fixtures.orientation.kind=normal"], "orientation.kind = normal; allowed: none, given"),
    ],
)
def test_refusals(tmp_path, capsys, changes, said):
    arguments = [text for change in changes for text in ("--set", change)]
    assert main(["run", "vf_forbidden_region", "--out", str(tmp_path / "out"), *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert len(error.splitlines()) == 1


@pytest.mark.slow
def test_a_start_inside_is_moved_out_slowly_where_that_is_chosen(tmp_path):
    log, _ = run(
        tmp_path,
        "vf_forbidden_region",
        1.4,
        "start.position=[0.95, 0.02, 0.88]",
        "fixtures.start_inside=move_out",
        "hand=null",
    )
    assert log["region_distance"][0, PARABOLOID] < -5e-4
    assert np.linalg.norm(log["velocity_command"], axis=1).max() < 0.0201
    assert log["region_distance"][-1, PARABOLOID] > -1e-4


@pytest.mark.slow
def test_a_lost_sensor_stops_the_robot_on_its_fixture(tmp_path):
    """The safe state, and no step of the tool."""
    lost = "simulation.force_sensor_failure={time: 1.9, component: 2}"
    log, _ = run(tmp_path, "vf_forbidden_region", 2.2, way(WAY), lost, status=3)
    assert log["mode"][-1, 0] == SURFACE
    assert log["t"][-1] < 2.1
    v = np.diff(log["y_t"], axis=0) / np.diff(log["t"])[:, None]
    assert np.linalg.norm(np.diff(v, axis=0), axis=1).max() < 0.05
