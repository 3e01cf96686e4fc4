"""Waypoints picked from a motion: distances, angles, rests, revolutions, gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Picking,
    WaypointTable,
    pick_waypoints,
    read_waypoints,
    waypoints_text,
)

SPACING, ANGLE = 0.01, np.deg2rad(3.0)
PICKING = Picking(SPACING, ANGLE)
LAP = Picking(SPACING, ANGLE, closed=True)


def line(length, begin=0.0, step=1e-4):
    x = begin + np.arange(0.0, length, step)
    return np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)


def circle(begin, end, radius=0.1, step=1e-3):
    angle = np.arange(begin, end, step)
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)


def chords(points):
    return np.linalg.norm(np.diff(points, axis=0), axis=1)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000))
def test_neighbours_are_as_far_apart_as_requested(seed):
    """Whatever the speed: never nearer, and at most one sample further."""
    random = np.random.default_rng(seed)
    steps = np.abs(np.repeat(random.normal(size=(20, 3)), 60, axis=0)) * random.uniform(0, 1e-3)
    points = np.cumsum(steps, axis=0)
    if np.linalg.norm(points[-1] - points[0]) < 2 * SPACING:
        return
    rows = pick_waypoints(points, None, PICKING)
    apart, longest = chords(points[rows]), chords(points).max()
    assert np.all(np.diff(rows) > 0)
    assert rows[0] == 0
    assert rows[-1] == len(points) - 1
    assert apart[:-1].min(initial=SPACING) >= SPACING
    assert apart[:-1].max(initial=0.0) <= SPACING + longest
    assert 0.5 * SPACING <= apart[-1] <= 1.5 * SPACING + 2.0 * longest


def test_a_rest_adds_no_waypoints():
    rest = np.tile([0.1, 0.0, 0.0], (20_000, 1))
    rest += np.random.default_rng(1).normal(scale=5e-4, size=rest.shape)
    way = np.vstack([line(0.1), rest, line(0.1, 0.1)])
    straight = np.vstack([line(0.1), line(0.1, 0.1)])
    picked, without = (pick_waypoints(y, None, PICKING) for y in (way, straight))
    assert abs(len(picked) - len(without)) <= 1
    inside = (picked > 1000) & (picked < 20_990)
    assert np.count_nonzero(inside) <= 1
    assert chords(way[picked])[:-1].min() >= SPACING


def test_turning_adds_waypoints():
    way = line(0.1)
    angles = np.linspace(0.0, np.deg2rad(60.0), len(way))
    R = Rotation.from_rotvec(angles[:, None] * [0.0, 0.6, 0.8]).as_matrix()
    rows = pick_waypoints(way, R, PICKING)
    # 6 deg per spacing: twice as many, up to the last, which is where the tool ended
    apart, turned = chords(way[rows])[:-1], np.rad2deg(np.diff(angles[rows]))[:-1]
    assert len(apart) >= 17
    assert apart == pytest.approx(np.full(len(apart), 0.5 * SPACING), abs=2e-4)
    assert turned == pytest.approx(np.full(len(apart), 3.0), abs=0.1)
    slow = Rotation.from_rotvec(0.1 * angles[:, None] * [0.0, 0.6, 0.8]).as_matrix()
    assert np.array_equal(pick_waypoints(way, slow, PICKING), pick_waypoints(way, None, PICKING))


def test_a_turn_where_the_tool_stands_is_refused():
    way = np.vstack([line(0.05), np.tile([0.05, 0.0, 0.0], (300, 1)), line(0.05, 0.05)])
    angles = np.concatenate([np.zeros(500), np.linspace(0.0, 1.0, 300), np.ones(500)])
    R = Rotation.from_rotvec(angles[:, None] * [1.0, 0.0, 0.0]).as_matrix()
    with pytest.raises(
        InputError, match=r"^taught path: the tool turned by 5\d.\d deg within 0.00\d+ m, aft"
    ):
        pick_waypoints(way, R, PICKING)


def test_samples_that_are_not_finite_are_passed_over():
    way = line(0.1)
    R = np.tile(np.eye(3), (len(way), 1, 1))
    way[:3], way[400:450, 1], R[700] = np.nan, np.inf, np.nan
    rows = pick_waypoints(way, R, PICKING)
    assert np.isfinite(way[rows]).all()
    assert rows[0] == 3
    assert 700 not in rows
    assert chords(way[rows])[:-1].min() >= SPACING


def test_the_end_is_the_last_waypoint():
    for length in (0.0521, 0.0549, 0.0562, 0.0599):
        way = line(length)
        rows = pick_waypoints(way, None, PICKING)
        assert rows[-1] == len(way) - 1
        assert chords(way[rows]).min() >= 0.5 * SPACING - 1e-12


@pytest.mark.parametrize("end", [2 * np.pi - 0.05, 2 * np.pi, 2 * np.pi + 0.07, 2 * np.pi + 2.5])
def test_a_revolution_is_cut_where_it_meets_its_begin(end):
    way = circle(0.3, 0.3 + end)
    rows = pick_waypoints(way, None, LAP)
    polygon = np.vstack([way[rows], way[rows[:1]]])
    assert chords(polygon).min() >= 0.5 * SPACING
    assert chords(polygon).max() <= 1.7 * SPACING
    # once round
    angle = np.unwrap(np.arctan2(polygon[:, 1], polygon[:, 0]))
    assert angle[-1] - angle[0] == pytest.approx(2.0 * np.pi)
    assert np.all(np.diff(angle) > 0.0)


def test_a_revolution_that_does_not_close_is_refused():
    with pytest.raises(InputError, match=r"^closed path: the tool ended 0.2 m from where it began"):
        pick_waypoints(circle(0.0, np.pi), None, LAP)


def test_a_revolution_without_motion_is_refused():
    with pytest.raises(InputError, match=r"^closed path: the tool went nowhere"):
        pick_waypoints(line(0.025), None, LAP)


@pytest.mark.parametrize(
    ("way", "message"),
    [
        (np.zeros((500, 3)), "nothing was taught: the tool never went further than 0 m"),
        (line(0.006), "nothing was taught: the tool never went further than 0.00"),
        (np.full((5, 3), np.nan), "taught motion: no sample with a finite position"),
        (np.zeros((0, 3)), "taught motion: no sample with a finite position"),
    ],
)
def test_a_hand_that_never_moved(way, message):
    with pytest.raises(InputError, match=f"^{message}"):
        pick_waypoints(way, None, PICKING)


def test_files_give_the_waypoints_back(tmp_path):
    random = np.random.default_rng(0)
    positions = random.normal(size=(7, 3))
    quaternions = Rotation.random(7, random_state=1).as_quat()
    file = tmp_path / "taught.csv"
    for q in (None, quaternions):
        file.write_text(waypoints_text(WaypointTable(positions, q), "by hand"), encoding="utf-8")
        table = read_waypoints(file)
        assert np.abs(table.positions - positions).max() <= 0.5e-7
        if q is None:
            assert table.quaternions is None
        else:
            assert np.abs(table.quaternions - q).max() <= 2e-9
