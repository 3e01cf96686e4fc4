"""Waypoints that arrive while the tool moves become a path on which it can always stop."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import BSpline

from pfsc_drake.control.streams.messages import StreamStatus, WaypointSender
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.errors import InputError
from tests.control.streams.streaming import PERIOD, make_stream, sent_at

# streams of the same start, order and parameters are built once
START, UPPER = np.array([0.8, 0.0, 1.1]), [2.0, 2.0, 2.0]
BEND = StreamParameters(spacing=0.012, velocity=0.5, upper=UPPER)
# hand-drawn: smoother than the waypoints, or through them
SMOOTHER, THROUGH = (
    StreamParameters(spacing=0.006, velocity=0.4, through=through, patience=0.2)
    for through in (False, True)
)


def bend(count=61):
    """Return waypoints about 0.02 m from each other, (count, 3)."""
    s = np.linspace(0.0, 0.02 * (count - 1), count)
    return np.stack([0.8 + 0.2 * np.sin(4.0 * s), s, 1.0 + 0.1 * np.cos(5.0 * s)], axis=1)


def even(count, rate=20.0):
    return np.arange(count) / rate


@pytest.fixture(name="run", scope="module")
def fixture_run():
    w = bend()
    stream = make_stream(BEND, w[0])
    return stream.run(sent_at(stream.layout, w[1:], even(len(w) - 1)), 6000, keep=10)


def whole_path(run):
    """Return the spline of all control points of a run of one piece, over the same theta."""
    d, columns = run.path.dimension, run.path.columns
    points = {}
    for path in run.paths:
        first = int(path[0])
        own = path[3 : 3 + d * columns].reshape(columns, d)
        # without those before the first waypoint
        points |= {first + k: own[k] for k in range(columns) if path[1] == 1.0}
    numbers = sorted(points)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    degree = run.path.order + 2
    knots = np.arange(numbers[0] - degree, numbers[-1] + 2, dtype=float)
    return BSpline(knots, np.array([points[n] for n in numbers]), degree)


def test_path_passes_all_waypoints_and_ends_at_the_last(run):
    w, moving = bend(), run.pieces == 1.0
    off = [np.linalg.norm(run.sigma[moving] - point, axis=1).min() for point in w]
    # 0.5 mm per tick
    assert max(off) < 3e-4
    np.testing.assert_allclose(run.sigma[-1], w[-1], rtol=0, atol=1e-7)
    assert run.stream[-1, 0] == StreamStatus.WAITING
    assert run.stream[-1, 1] == len(w) - 1


@pytest.mark.slow
def test_reference_never_passes_the_known_path_and_can_stop(run):
    assert run.overrun.max() <= 1e-12
    assert np.all(run.eta[:, 0] <= run.goal + 1e-12)
    assert run.eta[:, 1].max() > 0.9 * BEND.velocity
    assert np.abs(np.diff(run.eta[:, 1])).max() <= BEND.acceleration * PERIOD * (1.0 + 1e-6)


def test_control_points_never_change(run):
    d, columns, known = 3, run.path.columns, {}
    for path in run.paths:
        if path[1] != 1.0:
            continue
        own = path[3 : 3 + d * columns].reshape(columns, d)
        for k in range(columns):
            first = known.setdefault(int(path[0]) + k, own[k])
            assert np.array_equal(first, own[k])


@pytest.mark.slow
def test_arc_length_and_frame_are_those_of_the_whole_spline(run):
    spline, layout = whole_path(run), run.layout
    moving = np.flatnonzero(run.pieces == 1.0)
    first, last = run.points[moving[0]], run.points[-1]
    slope, bent = spline.derivative(1), spline.derivative(2)
    knots = np.arange(np.ceil(first[0]), last[0])
    length, _ = quad(
        lambda theta: np.linalg.norm(slope(theta)),
        first[0],
        last[0],
        limit=400,
        points=knots,
        epsabs=1e-11,
    )
    assert last[1] - first[1] == pytest.approx(length, abs=1e-9)

    def rate(theta, normal):
        tangent, speed = slope(theta), np.linalg.norm(slope(theta))
        turning = (bent(theta) - tangent * (tangent @ bent(theta)) / speed**2) / speed
        return -(turning @ normal) * tangent / speed

    begin = first[layout.normal]
    solved = solve_ivp(
        rate, (first[0], last[0]), begin, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.5
    )
    np.testing.assert_allclose(last[layout.normal], solved.y[:, -1], rtol=0, atol=1e-8)


def test_derivatives_are_those_of_the_whole_spline(run):
    spline, layout = whole_path(run), run.layout
    for k in (1500, 3000):
        found = run.points[k, layout.position].reshape(-1, 3)
        expected = [spline(run.points[k, 0], nu=j) for j in range(6)]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 3])
def test_paths_for_other_relative_degrees_end_at_the_same_point(order):
    w, parameters = bend(20), {1: THROUGH, 2: BEND, 3: SMOOTHER}[order]
    poses = np.hstack([w, np.tile([1.0, 0.0, 0.0, 0.0], (20, 1))]) if order == 2 else w
    stream = make_stream(parameters, poses[0], order=order)
    run = stream.run(sent_at(stream.layout, poses[1:], even(19)), 3500)
    np.testing.assert_allclose(run.sigma[-1], w[-1], rtol=0, atol=1e-7)
    assert run.overrun.max() <= 1e-12
    assert run.stream[-1, 0] == StreamStatus.WAITING


@pytest.mark.slow
def test_a_stream_with_a_pause_stops_at_its_last_point_and_continues_later():
    w = bend(40)
    times = even(39)
    times[20:] += 3.0
    stream = make_stream(BEND, w[0])
    run = stream.run(sent_at(stream.layout, w[1:], times), 7500)
    pause = round((times[20] - 0.01) / PERIOD)
    np.testing.assert_allclose(run.sigma[pause], w[20], rtol=0, atol=1e-7)
    assert run.stream[pause, 0] == StreamStatus.WAITING
    np.testing.assert_allclose(run.sigma[-1], w[-1], rtol=0, atol=1e-7)
    assert run.pieces[-1] == 2.0
    assert run.overrun.max() <= 1e-12
    assert np.linalg.norm(np.diff(run.sigma, axis=0), axis=1).max() < 1.01 * PERIOD * BEND.velocity


def zigzag():
    """Return waypoints with corners of 120 deg and 180 deg, and the numbers of the corners."""
    legs = [np.array([1.0, 0.0, 0.0]), np.array([-0.5, 0.8, 0.0]), np.array([0.5, -0.8, 0.0])]
    points, corners = [START], []
    for leg in legs:
        for _ in range(12):
            points.append(points[-1] + 0.02 * leg)
        corners.append(len(points) - 1)
    return np.array(points), corners[:-1]


def test_rests_at_corners_and_continues():
    w, corners = zigzag()
    stream = make_stream(BEND, w[0])
    run = stream.run(sent_at(stream.layout, w[1:], even(len(w) - 1)), 8000)
    np.testing.assert_allclose(run.sigma[-1], w[-1], rtol=0, atol=1e-9)
    assert StreamStatus.TURNING in run.stream[:, 0]
    assert run.pieces[-1] == 3.0
    for corner in corners:
        k = np.linalg.norm(run.sigma - w[corner], axis=1).argmin()
        np.testing.assert_allclose(run.sigma[k], w[corner], rtol=0, atol=1e-6)
        assert run.eta[k, 1] < 1e-4
    # straight lines: no corner is rounded
    for leg in np.split(w, [corners[0] + 1, corners[1] + 1]):
        assert all(np.linalg.norm(run.sigma - p, axis=1).min() < 3e-4 for p in leg)


def test_a_new_path_while_moving_is_blended():
    w, angle = bend(61), np.deg2rad(25.0)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    k_new, along = 1100, np.array([0.05, 1.0, 0.0])
    stream = make_stream(BEND, w[0])
    sender = WaypointSender(stream.layout)
    other = {}

    def message(k, stream_row):
        if k < k_new and k % 30 == 0:
            sender.add(w[1 + k // 30])
        if k == k_new:
            # beside the tool, some distance ahead
            start = w[round(stream_row[1])]
            for j in range(25):
                new = start + turn @ along * 0.02 * j + [0.03, 0.0, 0.0]
                other[j] = new
                sender.add(new, new_path=j == 0)
            sender.end()
        return sender.message

    run = stream.run(message, 6000, keep=1)
    assert run.overrun.max() <= 1e-12
    assert run.pieces[-1] == 1.0
    np.testing.assert_allclose(run.sigma[-1], other[24], rtol=0, atol=1e-4)
    moving = slice(k_new, k_new + 1500)
    assert run.eta[moving, 1].min() > 0.05
    # the path under the tool does not change: the motion is on one spline of class C^5
    spline = whole_path_driven(run)
    for k in range(400, 5000, 100):
        found = run.points[k, run.layout.position].reshape(-1, 3)
        expected = [spline(run.points[k, 0], nu=j) for j in range(6)]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


def whole_path_driven(run):
    """Return the spline of the control points at the time when the tool passed them."""
    d, columns, points = 3, run.path.columns, {}
    for path, point in zip(run.paths, run.points, strict=True):
        if path[1] == 1.0:
            own = path[3 : 3 + d * columns].reshape(columns, d)
            span = int(np.floor(point[0]))
            for n in range(span, span + run.path.spline.degree + 1):
                points[n] = own[n - int(path[0])]
    numbers = sorted(points)
    degree = run.path.spline.degree
    knots = np.arange(numbers[0] - degree, numbers[-1] + 2, dtype=float)
    return BSpline(knots, np.array([points[n] for n in numbers]), degree)


def test_missed_waypoints_end_the_path():
    w = bend(61)
    stream = make_stream(BEND, w[0])
    sender = sent_at(stream.layout, w[1:], even(60), end=False)
    newest = {}

    def message(k, stream):
        now = sender(k, stream)
        # interrupted for longer than messages go back
        if not 800 <= k < 2800:
            newest["last"] = now.copy()
        return newest["last"]

    run = stream.run(message, 5000)
    assert run.stream[-1, 0] == StreamStatus.MISSED
    np.testing.assert_allclose(run.sigma[-1], w[16], rtol=0, atol=1e-7)
    assert run.overrun.max() <= 1e-12


@pytest.mark.parametrize("new", [(), (5,)])
def test_a_sender_that_restarts_its_count_is_detected(new):
    """Its waypoints are skipped until a new path begins; late messages are no new sender."""
    w = bend(61)
    stream = make_stream(BEND, w[0])
    first = sent_at(stream.layout, w[1:], even(60), end=False)
    second = sent_at(stream.layout, w[16:40], 1.0 + even(24), new=new)
    history = []

    def message(k, stream):
        history.append(first(k, stream))
        if k >= 1000:
            return second(k, stream)
        # occasionally one that is 0.2 s old
        return history[max(0, k - 200)] if k % 50 == 0 else history[-1]

    run = stream.run(message, 3500)
    status = run.stream[:, 0]
    detected = int(np.argmax(status == StreamStatus.BEGUN_ANEW))
    assert 1040 < detected < 1060
    assert run.overrun.max() <= 1e-12
    if new:
        np.testing.assert_allclose(run.sigma[-1], w[39], rtol=0, atol=1e-7)
        assert status[-1] == StreamStatus.WAITING
    else:
        assert status[-1] == StreamStatus.BEGUN_ANEW
        off = np.linalg.norm(w - run.sigma[-1], axis=1)
        assert off.min() < 1e-6
        assert 15 <= off.argmin() <= 20


@pytest.mark.slow(but="bad1")
@pytest.mark.parametrize("bad", [[np.nan, 0.3, 1.0], [0.8, 9.0, 1.0]])
def test_an_invalid_waypoint_ends_the_path_until_a_new_one_begins(bad):
    w = bend(61)
    rows = w[1:].copy()
    rows[25] = bad
    rows[45] = w[26]
    stream = make_stream(BEND, w[0])
    messages = sent_at(stream.layout, rows, even(60), new=(45,))
    run = stream.run(messages, 7000)
    assert (run.stream[:, 0] == StreamStatus.REFUSED).any()
    # waypoints in between are skipped
    off = np.linalg.norm(run.sigma - w[25], axis=1)
    assert off.min() < 1e-6
    np.testing.assert_allclose(run.sigma[-1], w[-1], rtol=0, atol=1e-7)
    assert run.overrun.max() <= 1e-12


def test_a_refusal_persists_at_rest():
    """Further waypoints of the same path arrive after the stop, and have no effect."""
    w = bend(41)
    rows, times = w[1:].copy(), even(40)
    rows[25], times[30:] = [np.nan, 0.3, 1.0], times[30:] + 2.5
    stream = make_stream(BEND, w[0])
    run = stream.run(sent_at(stream.layout, rows, times), 5500)
    at_rest = round(times[30] / PERIOD) - 50
    np.testing.assert_allclose(run.sigma[at_rest], w[25], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(run.stream[at_rest:, 0], StreamStatus.REFUSED)
    np.testing.assert_allclose(run.sigma[-1], w[25], rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "count"), [(3, 40), *((k, 150) for k in range(4))])
def test_random_drawings_give_regular_paths_that_are_never_passed(seed, count):
    random = np.random.default_rng(seed)
    parameters, order = (THROUGH, 1) if seed % 2 else (SMOOTHER, 3)
    heading, points = 0.0, [START]
    for _ in range(count):
        heading += random.normal(0.0, 0.3) + (random.random() < 0.03) * random.uniform(-3.2, 3.2)
        step = random.exponential(0.006) * np.array([np.cos(heading), np.sin(heading), 0.0])
        points.append(points[-1] + step)
    times = np.cumsum(random.exponential(0.016, count) + (random.random(count) < 0.015) * 1.5)
    stream = make_stream(parameters, points[0], order=order)
    run = stream.run(
        sent_at(stream.layout, np.array(points[1:]), times, heard=True), 100 * count + 1000
    )
    assert np.isfinite(run.points).all()
    assert run.overrun.max() <= 1e-12
    assert np.abs(np.diff(run.eta[:, 1])).max() <= parameters.acceleration * PERIOD * (1 + 1e-6)
    slope, second = (
        run.points[:, run.layout.position].reshape(-1, order + 2, 3)[:, k] for k in (1, 2)
    )
    speed = np.linalg.norm(slope, axis=1)
    curvature = np.linalg.norm(np.cross(slope, second), axis=1) / speed**3
    assert speed.min() > 0.1 * parameters.spacing
    assert curvature.max() < 1.15 / parameters.least_radius
    # low speed in bends
    across = curvature * run.eta[:, 1] ** 2
    assert across.max() < 1.3 * parameters.normal_acceleration
    assert run.stream[-1, 0] == StreamStatus.WAITING
    assert np.linalg.norm(run.sigma[-1] - points[-1]) < parameters.spacing


@pytest.mark.slow
def test_waypoints_with_orientations():
    w = bend(40)
    angles = np.linspace(0.0, 1.2, 40)
    q = np.stack([np.cos(angles / 2), np.sin(angles / 2), 0 * angles, 0 * angles], axis=1)
    q[7::5] *= -1.0  # the same orientations
    poses = np.hstack([w, q])
    stream = make_stream(BEND, poses[0], order=2)
    run = stream.run(sent_at(stream.layout, poses[1:], even(39)), 5000)
    found = run.points[:, run.layout.quaternion][:, :4]
    found /= np.linalg.norm(found, axis=1)[:, None]
    assert abs(found[-1] @ q[-1]) == pytest.approx(1.0, abs=1e-7)
    for k in range(0, 40, 3):
        near = np.linalg.norm(run.sigma - w[k], axis=1).argmin()
        assert abs(found[near] @ q[k]) > np.cos(0.02 / 2)
    assert np.abs(np.diff(found, axis=0)).max() < 1e-2


def test_senders_reject_invalid_waypoints():
    stream = make_stream(BEND, bend()[0])
    sender = WaypointSender(stream.layout, lower=[0.0, -1.0, 0.0], upper=[1.0, 1.0, 1.0])
    with pytest.raises(InputError, match=r"waypoint 1: \[nan, 0.0, 0.0\]; must be 3 finite"):
        sender.add([np.nan, 0.0, 0.0])
    with pytest.raises(InputError, match=r"waypoint 1: \[0.5, 2.0, 0.5\] m; must be from"):
        sender.add([0.5, 2.0, 0.5])
    assert sender.total == 0
