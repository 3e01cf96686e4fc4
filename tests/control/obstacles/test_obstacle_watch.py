"""Motions that wait for obstacles: passing, waiting, retreat, and rest near an obstacle."""

import dataclasses as dc

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.obstacles.obstacle_watch import STEPS, ArmAhead, ObstacleWatch
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
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
    """Tool on slides along x and z that follows a path along x with a reference of order 4."""

    def __init__(self, length=1.5, parameters=PARAMETERS, **resting):
        chain = SerialChain(
            (_slide([1.0, 0, 0]), _slide([0, 0, 1.0])), np.eye(3), np.array([0, 0, 0.3])
        )
        motion = rest_to_rest([0.0, length], velocity=0.5, acceleration=2.0, dwell=0.2)
        self.scaling = StoppableScaling(4, 30.0, resting.get("resting", 0.05))
        step = parameters.horizon / STEPS
        times = step * np.arange(int(np.ceil(motion.domain[1] / step)) + 1)
        x = motion.derivatives(np.minimum(times, motion.domain[1]), 0)[:, 0, 0]
        outline = arm_outline(chain, 0.1)
        q = np.vstack([x, np.zeros(len(x))])
        points = outline_points(chain, outline).map(len(x))(q).full().T
        ahead = ArmAhead(chain, outline, 0.0, step, points)
        self.between = ahead.between
        self.reference = Stepper(WaitingReference(motion, self.scaling, 1, PERIOD))
        self.watch = Stepper(
            ObstacleWatch(ahead, [SHAPE], parameters, self.scaling, PERIOD), ("requested",)
        )
        self.reference.start(override=0.0)
        self.x, self.clock = 0.0, np.zeros(6)

    def step(self, obstacle, requested=1.0):
        """Return tool position, speed scaling and record of a tick."""
        state = np.array([self.x, 0, 0, 0, self.x, 0, 0, 0])
        watched = self.watch.step(
            clock=self.clock, joint_state=state, obstacles=obstacle, requested=[requested]
        )
        out = self.reference.step(override=watched["override"])
        # inputs of the next tick: the clock is a state
        self.x = float(out["reference"][0])
        self.clock = out["clock"]
        return self.x, float(self.clock[1]), watched["record"]


def _standing(x, y=0.0):
    return np.array([x, y, 0.0, 0.0, 0.0, 0.0])


def test_planned_motion_without_obstacles():
    crane = _Crane(length=0.5)
    for _ in range(2000):
        x, _, record = crane.step(_standing(0.0, 50.0))
        assert record[1] == 1.0
    assert x == pytest.approx(0.5, abs=1e-9)


def test_waits_before_a_person_on_the_path_and_goes_on_afterwards():
    crane = _Crane()
    for _ in range(4000):
        x, scaling, _ = crane.step(_standing(1.4))
    gap = 1.4 - x - SHAPE.radius - 0.1
    # at reduced speed, up to the point that the person can reach in time
    assert 0.4 < gap < 0.5
    assert crane.scaling.resting < scaling < 0.1
    for _ in range(4000):
        x, _, _ = crane.step(_standing(1.4, 50.0))
    assert x == pytest.approx(1.5, abs=1e-6)


def test_scaling_is_that_of_the_time_until_an_obstacle_can_be_at_the_margin():
    """An obstacle beside the start; the next samples are farther away."""
    crane, p = _Crane(), PARAMETERS
    between = crane.between
    assert between > 1e-3
    for y in (0.7, 0.8):
        _, _, record = crane.step(np.array([0.0, y, 0.0, 0.0, 0.0, 0.0]))
        gap = y - SHAPE.radius - 0.1 - p.margin - p.uncertainty - between
        time = gap / p.largest_speed - p.latency - PERIOD
        permitted = float(crane.scaling.largest_request(ca.DM(time), [0.0] * 4))
        assert 0.05 < permitted < 1.0
        assert record[1] == pytest.approx(permitted, rel=1e-9)
        assert record[0] == pytest.approx(y - SHAPE.radius - 0.1)
        crane = _Crane()


def test_requested_pause():
    crane = _Crane()
    scalings = [crane.step(_standing(0.0, 50.0), 0.0)[1] for _ in range(500)]
    assert max(scalings) == 0.0
    for _ in range(500):
        _, scaling, _ = crane.step(_standing(0.0, 50.0), 0.4)
    assert scaling == pytest.approx(0.4, abs=1e-3)


def test_nan_stops_the_motion():
    crane = _Crane()
    for _ in range(600):
        _, scaling, _ = crane.step(_standing(0.0, 50.0))
    assert scaling > 0.9
    for _ in range(600):
        _, scaling, record = crane.step(np.full(6, np.nan))
    assert scaling < 1e-3
    assert np.isnan(record[0])


def test_motion_starts_only_with_a_measurement():
    crane = _Crane()
    for _ in range(300):
        crane.step(np.full(6, np.nan))
    assert crane.clock[0] == 0.0
    for _ in range(300):
        _, scaling, _ = crane.step(_standing(0.0, 50.0))
    assert scaling > 0.9


@pytest.mark.slow
def test_passes_before_a_person_who_arrives_later():
    """The person reaches the path after two seconds: the tool passes before, without waiting."""
    crane, waited = _Crane(length=1.0), False
    for k in range(2800):
        y = 4.5 - 0.9 * k * PERIOD
        _, scaling, _ = crane.step(np.array([0.1, y, 0.0, 0.0, -0.9, 0.0]))
        waited |= k > 400 and scaling < 0.99
    assert not waited
    assert crane.x == pytest.approx(1.0, abs=1e-3)


BOUNDED = dc.replace(PARAMETERS, largest_acceleration=5.0, velocity_uncertainty=0.1)


@pytest.mark.slow(but="0-parameters0")
@pytest.mark.parametrize("parameters", [PARAMETERS, BOUNDED, dc.replace(BOUNDED, retreat=1.0)])
@pytest.mark.parametrize("seed", [0, 2, 4])
def test_tool_rests_before_any_obstacle_within_its_bounds_is_near(seed, parameters):
    """Worst case: the person runs towards the tool, waits and runs again, at the speed limit."""
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
        to_go = (np.array([crane.x, 0.0]) if target is None else target) - p
        change = 1.6 * to_go / max(np.linalg.norm(to_go), 0.05) - v
        v = v + change * min(1.0, hasty * PERIOD / max(np.linalg.norm(change), 1e-9))
        p = p + v * PERIOD
        shown.append(np.append(p, v))
        noise = np.append(rng.uniform(-1, 1, 2) * 0.02, rng.uniform(-1, 1, 2) * 0.1) / np.sqrt(2)
        x, y, v_x, v_y = shown[-late] + noise
        before = crane.x
        x, scaling, _ = crane.step(np.array([x, y, 0.0, v_x, v_y, 0.0]))
        moved += abs(x - before)
        gap = np.linalg.norm(p - [x, 0.0]) - SHAPE.radius - 0.1
        if abs(scaling) > crane.scaling.resting:
            least = min(least, gap)
    assert least >= parameters.margin
    assert moved > 0.02


@pytest.mark.slow
def test_known_acceleration_limit_lets_the_motion_continue_sooner():
    """The person has crossed and walks away, and cannot reverse immediately."""
    distances = []
    for parameters in (PARAMETERS, BOUNDED):
        crane = _Crane(parameters=parameters)
        for k in range(2200):
            y = -1.2 + 1.2 * k * PERIOD
            crane.step(np.array([0.4, y, 0.0, 0.0, 1.2, 0.0]))
        distances.append(crane.x)
    assert distances[1] > distances[0] + 0.1


@pytest.mark.slow
def test_retreats_from_an_approaching_person_and_continues_afterwards():
    """The person comes along the path to the waiting tool, stops there, and turns round."""
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


def test_no_obstacles_is_an_error():
    with pytest.raises(InputError, match="obstacles: none"):
        ObstacleWatch(None, [], PARAMETERS, None, PERIOD)
