"""Progress that waits: what passes, where it waits, and that no obstacle finds it moving."""

import dataclasses as dc

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.obstacles.obstacle_watch import STEPS, ArmAhead, ObstacleWatch
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.robot.serial.outline import arm_outline, outline_points

PERIOD = 1e-3
PARAMETERS = WatchParameters(margin=0.15, largest_speed=1.6, uncertainty=0.02, latency=0.05)
SHAPE = ObstacleShape("column", 0.2)


def _slide(axis, kind="prismatic", p=(0.0, 0.0, 0.0)):
    body = {"mass": 1.0, "p_LC": np.zeros(3), "I_C": np.eye(3)}
    return ChainLink("slide", kind, np.eye(3), np.array(p), np.array(axis), **body)


class _Crane:
    """A tool on slides along x and z, which a path along x moves with a reference of order 4."""

    def __init__(self, length=1.5, parameters=PARAMETERS, **resting):
        chain = SerialChain(
            (_slide([1.0, 0, 0]), _slide([0, 0, 1.0])), np.eye(3), np.array([0, 0, 0.3])
        )
        motion = rest_to_rest([0.0, length], velocity=0.5, acceleration=2.0, dwell=0.2)
        self.pace = WaitingPace(4, 30.0, resting.get("resting", 0.05))
        step = parameters.horizon / STEPS
        times = step * np.arange(int(np.ceil(motion.domain[1] / step)) + 1)
        x = motion.derivatives(np.minimum(times, motion.domain[1]), 0)[:, 0, 0]
        outline = arm_outline(chain, 0.1)
        q = np.vstack([x, np.zeros(len(x))])
        points = outline_points(chain, outline).map(len(x))(q).full().T
        ahead = ArmAhead(chain, outline, 0.0, step, points)
        self.between = ahead.between
        self.reference = Stepper(WaitingReference(motion, self.pace, 1, PERIOD))
        self.watch = Stepper(
            ObstacleWatch(ahead, [SHAPE], parameters, self.pace, PERIOD), ("asked",)
        )
        self.reference.start(override=0.0)
        self.x, self.clock = 0.0, np.zeros(6)

    def step(self, obstacle, asked=1.0):
        """Return where the tool is, the pace and the record of a tick."""
        state = np.array([self.x, 0, 0, 0, self.x, 0, 0, 0])
        told = self.watch.step(
            clock=self.clock, joint_state=state, obstacles=obstacle, asked=[asked]
        )
        out = self.reference.step(override=told["override"])
        # what the next tick sees: the clock is a state
        self.x = float(out["reference"][0])
        self.clock = out["clock"]
        return self.x, float(self.clock[1]), told["record"]


def _standing(x, y=0.0):
    return np.array([x, y, 0.0, 0.0, 0.0, 0.0])


def test_nobody_near_leaves_the_planned_motion():
    crane = _Crane(length=0.5)
    for _ in range(2000):
        x, _, record = crane.step(_standing(0.0, 50.0))
        assert record[1] == 1.0
    assert x == pytest.approx(0.5, abs=1e-9)


def test_it_waits_before_one_who_stands_on_the_path_and_goes_on_when_he_has_gone():
    crane = _Crane()
    for _ in range(4000):
        x, pace, _ = crane.step(_standing(1.4))
    gap = 1.4 - x - SHAPE.radius - 0.1
    # at reduced speed, to where he could not be in time if he set off
    assert 0.4 < gap < 0.5
    assert crane.pace.resting < pace < 0.1
    for _ in range(4000):
        x, _, _ = crane.step(_standing(1.4, 50.0))
    assert x == pytest.approx(1.5, abs=1e-6)


def test_the_pace_is_that_of_the_time_until_he_can_be_at_the_margin():
    """Beside the start, whose next samples are farther away."""
    crane, p = _Crane(), PARAMETERS
    between = crane.between
    assert between > 1e-3
    for y in (0.7, 0.8):
        _, _, record = crane.step(np.array([0.0, y, 0.0, 0.0, 0.0, 0.0]))
        gap = y - SHAPE.radius - 0.1 - p.margin - p.uncertainty - between
        time = gap / p.largest_speed - p.latency - PERIOD
        permitted = float(crane.pace.permitted(ca.DM(time), [0.0] * 4))
        assert 0.05 < permitted < 1.0
        assert record[1] == pytest.approx(permitted, rel=1e-9)
        assert record[0] == pytest.approx(y - SHAPE.radius - 0.1)
        crane = _Crane()


def test_a_pause_that_is_asked_for_is_one():
    crane = _Crane()
    paces = [crane.step(_standing(0.0, 50.0), 0.0)[1] for _ in range(500)]
    assert max(paces) == 0.0
    for _ in range(500):
        _, pace, _ = crane.step(_standing(0.0, 50.0), 0.4)
    assert pace == pytest.approx(0.4, abs=1e-3)


def test_what_is_no_number_stops_it():
    crane = _Crane()
    for _ in range(600):
        _, pace, _ = crane.step(_standing(0.0, 50.0))
    assert pace > 0.9
    for _ in range(600):
        _, pace, record = crane.step(np.full(6, np.nan))
    assert pace < 1e-3
    assert np.isnan(record[0])


def test_who_is_not_seen_at_first_keeps_it_waiting_until_he_is():
    crane = _Crane()
    for _ in range(300):
        crane.step(np.full(6, np.nan))
    assert crane.clock[0] == 0.0
    for _ in range(300):
        _, pace, _ = crane.step(_standing(0.0, 50.0))
    assert pace > 0.9


@pytest.mark.slow
def test_the_way_is_free_ahead_of_one_who_comes_slowly_later():
    """He would be on the path in two seconds: the tool is past before, and does not wait."""
    crane, waited = _Crane(length=1.0), False
    for k in range(2800):
        y = 4.5 - 0.9 * k * PERIOD
        _, pace, _ = crane.step(np.array([0.1, y, 0.0, 0.0, -0.9, 0.0]))
        waited |= k > 400 and pace < 0.99
    assert not waited
    assert crane.x == pytest.approx(1.0, abs=1e-3)


BOUNDED = dc.replace(PARAMETERS, largest_acceleration=5.0, velocity_uncertainty=0.1)


@pytest.mark.slow(but="0-parameters0")
@pytest.mark.parametrize("parameters", [PARAMETERS, BOUNDED, dc.replace(BOUNDED, retreat=1.0)])
@pytest.mark.parametrize("seed", [0, 2, 4])
def test_nobody_within_his_limits_finds_the_tool_moving(seed, parameters):
    """He does his worst: runs towards the tool, waits, runs again, as fast as is allowed."""
    rng, crane = np.random.default_rng(seed), _Crane(parameters=parameters)
    late, hasty = round(PARAMETERS.latency / PERIOD), parameters.largest_acceleration or 1e9
    p = np.array([rng.uniform(0.3, 1.6), rng.choice([-1.0, 1.0]) * rng.uniform(1.5, 2.5)])
    v, shown = np.zeros(2), [np.append(p, [0.0, 0.0])] * late
    target, least, moved = p, np.inf, 0.0
    for k in range(4000):
        if k % 400 == 0:
            away = rng.random() < 0.6
            target = np.array([rng.uniform(0, 1.5), 2.5 * rng.choice([-1.0, 1.0])])
            target = target if away else None
        way = (np.array([crane.x, 0.0]) if target is None else target) - p
        change = 1.6 * way / max(np.linalg.norm(way), 0.05) - v
        v = v + change * min(1.0, hasty * PERIOD / max(np.linalg.norm(change), 1e-9))
        p = p + v * PERIOD
        shown.append(np.append(p, v))
        noise = np.append(rng.uniform(-1, 1, 2) * 0.02, rng.uniform(-1, 1, 2) * 0.1) / np.sqrt(2)
        x, y, v_x, v_y = shown[-late] + noise
        before = crane.x
        x, pace, _ = crane.step(np.array([x, y, 0.0, v_x, v_y, 0.0]))
        moved += abs(x - before)
        gap = np.linalg.norm(p - [x, 0.0]) - SHAPE.radius - 0.1
        if abs(pace) > crane.pace.resting:
            least = min(least, gap)
    assert least >= parameters.margin
    assert moved > 0.02


@pytest.mark.slow
def test_who_accelerates_no_faster_than_is_known_lets_it_go_on_sooner():
    """He has crossed and walks away: only that he cannot turn round at once lets it go."""
    ways = []
    for parameters in (PARAMETERS, BOUNDED):
        crane = _Crane(parameters=parameters)
        for k in range(2200):
            y = -1.2 + 1.2 * k * PERIOD
            crane.step(np.array([0.4, y, 0.0, 0.0, 1.2, 0.0]))
        ways.append(crane.x)
    assert ways[1] > ways[0] + 0.1


@pytest.mark.slow
def test_it_goes_back_from_one_who_walks_up_to_it_and_on_when_he_has_gone():
    """He comes along the path to where it waits, and stops there before he turns round."""
    least = {}
    for retreat in (0.0, 1.0):
        crane = _Crane(parameters=dc.replace(BOUNDED, retreat=retreat))
        gaps, passing = [], set()
        for k in range(6000):
            t = k * PERIOD
            there = 2.3 - min(max(t - 1.0, 0.0), 2.0) * 0.8 + max(t - 3.5, 0.0) * 0.8
            v = -0.8 * (1.0 < t < 3.0) + 0.8 * (t > 3.5)
            x, _, record = crane.step(np.array([there, 0.0, 0.0, v, 0.0, 0.0]))
            gaps.append(there - x - SHAPE.radius - 0.1)
            passing.add(float(record[2]))
        least[retreat] = min(gaps)
        assert (-1.0 in passing) == (retreat > 0.0)
    assert least[0.0] < PARAMETERS.margin <= least[1.0]
    assert x > 0.8


def test_there_must_be_something_to_watch():
    with pytest.raises(InputError, match="obstacles: none"):
        ObstacleWatch(None, [], PARAMETERS, None, PERIOD)
