"""An operator who mounts a plate, on poses that are prescribed."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandParameters, HandWaypoint
from pfsc_drake.physics.mounting_hand import MountingHand, MountingHandParameters, MountingPhase

PERIOD, PINS = 1e-3, 0.012
GOAL_R = Rotation.from_euler("ZYX", [25.0, 10.0, 180.0], degrees=True)
GOAL_P = np.array([0.8, 0.3, 0.6])
BEGIN, END = 0.5, 1.5  # s, of the waypoints
# sees without error, and leads a tool that may be anywhere
SURE = {"eye_error": 0.0, "eye_angle": 0.0, "reach": 10.0}


SIZES = {"time": 1, "pose": 12, "twist": 6, "held": 1}


class Operator:
    """The block's expressions as functions of its state, in one vector."""

    def __init__(self, block):
        self.block, self._sizes = block, list(block.states.values())
        state = ca.MX.sym("state", sum(self._sizes))
        parts = ca.vertsplit(state, np.cumsum([0, *self._sizes]).tolist())
        x = Values(**dict(zip(block.states, parts, strict=True)))
        time, pose, twist, held = (ca.MX.sym(name, n) for name, n in SIZES.items())
        after = ca.vertcat(*(vars(x) | block.next_states(x, time, pose, held)).values())
        vacuum = block.output(x, Values(), 0.0)["vacuum"]
        desired_wrench = block.desired_wrench(x, time, pose, twist)
        self._step = ca.Function("step", [state, time, pose, held], [after])
        self._wanted = ca.Function("wanted", [state, time, pose, twist], [desired_wrench])
        self._shown = ca.Function("shown", [state], [x.phase, vacuum])

    def start(self, **changes):
        initial = self.block.initial(Values(), 0.0) | changes
        return ca.vertcat(
            *[ca.DM(initial.get(name, np.zeros(n))) for name, n in self.block.states.items()]
        )

    def go(self, state, time, ticks, where, held):
        times = time + PERIOD * np.arange(ticks)
        poses, helds = np.tile(where[:, None], ticks), np.full((1, ticks), held)
        return self._step.fold(ticks)(state, times[None], poses, helds)

    def desired_wrench(self, state, time, where, twist):
        return self._wanted(state, time, where, twist).full().ravel()

    def phase(self, state):
        return MountingPhase(int(self._shown(state)[0]))

    def vacuum(self, state):
        return bool(self._shown(state)[1])


def hand(**changes):
    waypoints = [HandWaypoint(BEGIN, [0.7, -0.4, 0.5]), HandWaypoint(END, pose(-0.02)[:3])]
    lead, mounting = HandParameters(waypoints, stiffness=250.0), MountingHandParameters(**changes)
    return Operator(MountingHand(lead, mounting, (GOAL_P, GOAL_R.as_matrix()), PINS, PERIOD))


def pose(depth=-0.1, beside=(0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """Return a tool so deep in its seat [m], with an error in the seat's axes."""
    R = GOAL_R * Rotation.from_rotvec(turn)
    return np.concatenate([GOAL_P + GOAL_R.apply([*beside, depth]), R.as_matrix().ravel()])


def go(operator, state, time, duration, where, held=1.0):
    """Return state and time after a while at a pose."""
    ticks = round(duration / PERIOD)
    return operator.go(state, time, ticks, where, held), time + ticks * PERIOD


def test_it_mounts_phase_by_phase():
    operator = hand(**SURE)
    state, time = operator.start(), 0.0
    phases, vacuum = [], []

    def stay(duration, where, held):
        nonlocal state, time
        state, time = go(operator, state, time, duration, where, held)
        phases.append(operator.phase(state).name)
        vacuum.append(operator.vacuum(state))

    away = np.concatenate([[0.7, -0.4, 0.5], GOAL_R.as_matrix().ravel()])
    stay(1.0, away, 0.75)  # three of four cups are not enough
    stay(0.1, away, 1.0)
    stay(END - BEGIN + 0.2, pose(-0.02), 1.0)
    stay(0.1, pose(-PINS - 2e-3), 1.0)
    stay(2.0, pose(-1e-3), 1.0)  # something is in the way
    stay(1.0, pose(0.0), 1.0)
    stay(0.6, pose(0.0), 0.0)
    stay(0.1, pose(-0.02), 0.0)
    assert phases == ["GRIP", "LEAD", "ALIGN", "INSERT", "INSERT", "RELEASE", "LEAVE", "DONE"]
    assert vacuum == [True] * 5 + [False] * 3


def test_on_return_it_releases_first_and_grasps_last():
    operator = hand(task="return", **SURE)
    state, time = operator.start(), 0.0
    assert operator.vacuum(state)
    state, time = go(operator, state, time, BEGIN + 1.0, pose(0.0))
    assert operator.phase(state) is MountingPhase.LEAD
    assert not operator.vacuum(state)
    state, time = go(operator, state, time, 1.5, pose(-0.02), held=0.0)
    assert operator.phase(state) is MountingPhase.GRIP
    assert operator.vacuum(state)
    state, time = go(operator, state, time, 0.1, pose(-0.02), held=1.0)
    assert operator.phase(state) is MountingPhase.DONE
    assert operator.vacuum(state)


def gripped(operator):
    state, time = go(operator, operator.start(), 0.0, BEGIN + 0.01, pose(), 1.0)
    assert operator.phase(state) is MountingPhase.LEAD
    return state, time


def test_the_hand_that_leads_waits_for_the_tool():
    operator = hand(reach=0.1)
    state, time = gripped(operator)
    stuck = np.concatenate([[0.7, -0.4, 0.5], GOAL_R.as_matrix().ravel()])
    state, time = go(operator, state, time, 5.0, stuck)
    assert operator.phase(state) is MountingPhase.LEAD
    force = operator.desired_wrench(state, time, stuck, np.zeros(6))[:3]
    assert np.linalg.norm(force) == pytest.approx(250.0 * 0.1, rel=0.01)


def inserting(**changes):
    operator = hand(look_time=0.01, **SURE | changes)
    state, time = gripped(operator)
    state, time = go(operator, state, time, END - BEGIN + 0.1, pose(-0.02))
    assert operator.phase(state) is MountingPhase.INSERT
    return operator, state, time


def test_it_pushes_beside_the_axis_towards_what_it_sees():
    operator, state, time = inserting(persistence=0.0, turning_persistence=0.0)
    p = MountingHandParameters()
    error, turn = np.array([6e-4, -8e-4]), np.array([0.004, -0.002, 0.006])
    wrench = operator.desired_wrench(state, time, pose(-PINS, error, turn), np.zeros(6))
    force = GOAL_R.inv().apply(wrench[:3])
    np.testing.assert_allclose(force, [*(-p.stiffness * error), p.insert], rtol=1e-6)
    torque = GOAL_R.inv().apply(wrench[3:])
    np.testing.assert_allclose(torque, -p.turning_stiffness * turn, rtol=1e-3)


HOVERING = -PINS - 2e-3


def aligned(where, duration, **changes):
    """Return an operator who has looked at a plate beside its bores for a while."""
    operator = hand(look_time=duration, **SURE | {"stiffness": 0.0} | changes)
    state, time = gripped(operator)
    state, time = go(operator, state, time, END - BEGIN, where)
    assert operator.phase(state) is MountingPhase.ALIGN
    return operator, *go(operator, state, time, duration, where)


@pytest.mark.slow
def test_it_pushes_more_as_long_as_nothing_moves_up_to_a_limit():
    p, where = MountingHandParameters(), pose(HOVERING, [5e-4, 0.0])
    for duration, expected in (
        (2.0, p.persistence * 5e-4 * 2.0),
        (12.0, p.side_limit),
    ):
        operator, state, time = aligned(where, duration)
        force = GOAL_R.inv().apply(operator.desired_wrench(state, time, where, np.zeros(6))[:3])
        np.testing.assert_allclose(force[:2], [-expected, 0.0], atol=2e-3 * expected)


def test_nobody_pushes_more_and_more_against_what_is_touched():
    operator, state, time = inserting(stiffness=0.0)
    where = pose(-PINS, [5e-4, 0.0])
    before = operator.desired_wrench(state, time, where, np.zeros(6))
    state, time = go(operator, state, time, 2.0, where)
    assert operator.phase(state) is MountingPhase.INSERT
    np.testing.assert_allclose(operator.desired_wrench(state, time, where, np.zeros(6)), before)


@pytest.mark.slow
def test_it_feels_for_the_bores_in_a_spiral():
    operator, state, time = inserting(persistence=0.0)
    p, where, offsets = MountingHandParameters(), pose(-PINS), []
    for _ in range(600):
        state, time = go(operator, state, time, 0.01, where)
        force = operator.desired_wrench(state, time, where, np.zeros(6))[:3]
        offsets.append(GOAL_R.inv().apply(force)[:2] / p.stiffness)
    sizes = np.linalg.norm(offsets, axis=1)
    assert sizes.max() == pytest.approx(p.search_radius, rel=1e-6)
    assert np.all(np.diff(sizes) > -1e-12)
    turned = np.unwrap(np.arctan2(*np.array(offsets)[100:].T[::-1]))
    assert turned[-1] - turned[0] == pytest.approx(2.0 * np.pi * 4.99 / p.search_period, rel=1e-3)


def test_once_the_pins_are_in_the_hands_follow():
    p = MountingHandParameters()
    operator, state, time = aligned(pose(HOVERING, [1e-3, 0.0]), 2.0, wobble=0.0)
    state, time = go(operator, state, time, 0.1, pose(HOVERING, [1e-3, 0.0]))
    deep = pose(-PINS + 6e-3, [1e-3, 0.0])
    before = GOAL_R.inv().apply(operator.desired_wrench(state, time, deep, np.zeros(6))[:3])
    # what persistence led to, without the push of what is seen
    assert -before[0] == pytest.approx(p.persistence * 1e-3 * 2.0, rel=0.02)
    state, time = go(operator, state, time, p.relaxation, deep)
    after = GOAL_R.inv().apply(operator.desired_wrench(state, time, deep, np.zeros(6))[:3])
    assert after[0] / before[0] == pytest.approx(np.exp(-1.0), rel=1e-2)


@pytest.mark.slow
def test_the_eye_errs_by_what_the_seed_says_and_never_much():
    """Seen from the push on a tool that is in place: the same for a seed, within two deviations."""
    p, observed = MountingHandParameters(), []
    for seed in range(40):
        operator = hand(seed=seed, eye_angle=0.0)
        state = operator.start(phase=float(MountingPhase.INSERT), since=0.0)
        force = operator.desired_wrench(state, 0.1, pose(-PINS), np.zeros(6))[:3]
        observed.append(GOAL_R.inv().apply(force)[:2] / p.stiffness)
    assert np.abs(observed).max() <= 2.0 * p.eye_error * (1.0 + 1e-9)
    assert np.std(observed) == pytest.approx(p.eye_error, rel=0.3)
    assert len(np.unique(np.round(observed, 9), axis=0)) == 40


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"task": "mend"}, "task = mend; allowed: mount or return"),
        ({"press": 0.0}, "press = 0.0; allowed: a positive number"),
        ({"eye_error": -1e-3}, "eye_error = -0.001"),
        ({"search_period": np.inf}, "search_period = inf"),
        ({"seed": -1}, "seed = -1"),
    ],
)
def test_wrong_numbers_are_refused(changes, part):
    with pytest.raises(InputError, match=part):
        MountingHandParameters(**changes)


def test_the_eye_errs_about_the_axes_of_the_goal():
    """The view is turned by an error whose axis is given in the seat, which is not the world."""
    changes = {"seed": 3, "eye_angle": 0.02}
    operator, state, time = inserting(
        persistence=0.0, turning_persistence=0.0, eye_error=0.0, **changes
    )
    draws = np.random.default_rng(3).standard_normal(5)
    torque = operator.desired_wrench(state, time, pose(-PINS), np.zeros(6))[3:]
    error = 0.02 * np.clip(draws[2:], -2.0, 2.0)
    expected = MountingHandParameters().turning_stiffness * error
    np.testing.assert_allclose(GOAL_R.inv().apply(torque), expected, rtol=1e-2)


def test_once_the_pins_are_in_the_moment_relaxes_too():
    p, turn = MountingHandParameters(), [0.0, 0.0, 0.01]
    where = pose(HOVERING, turn=turn)
    operator, state, time = aligned(where, 2.0, wobble=0.0)
    state, time = go(operator, state, time, 0.1, where)
    deep = pose(-PINS + 6e-3, turn=turn)
    before = GOAL_R.inv().apply(operator.desired_wrench(state, time, deep, np.zeros(6))[3:])
    assert -before[2] == pytest.approx(p.turning_persistence * 0.01 * 2.0, rel=0.02)
    state, time = go(operator, state, time, p.relaxation, deep)
    after = GOAL_R.inv().apply(operator.desired_wrench(state, time, deep, np.zeros(6))[3:])
    assert after[2] / before[2] == pytest.approx(np.exp(-1.0), rel=1e-2)


DELAY, TAKES, RAMP = 0.05, 0.1, 0.02


def over_time(held, duration):
    """Return times and outputs of an operator over a tool that does not move."""
    lead = HandParameters(
        [HandWaypoint(TAKES, [0.0, 0.0, 0.5]), HandWaypoint(1.0, [0.0, 0.0, 0.6])],
        reaction_delay=DELAY,
        grip_ramp=RAMP,
        force_limit=30.0,
    )
    goal, mounting = (np.array([0.3, 0.0, 0.5]), np.eye(3)), MountingHandParameters(press=40.0)
    stepper = Stepper(MountingHand(lead, mounting, goal, 0.01, PERIOD))
    still = np.concatenate([[0.0, 0.0, 0.5], np.eye(3).ravel()])
    time = PERIOD * np.arange(round(duration / PERIOD))
    found = [stepper.step(tool_pose=still, held=held) for _ in time]
    return time, {name: np.array([values[name] for values in found]) for name in found[0]}


def test_it_grips_with_a_limited_force_after_its_reaction_delay():
    time, log = over_time(held=0.0, duration=0.4)
    assert (log["phase"] == MountingPhase.GRIP).all()
    assert (log["vacuum"] == 1.0).all()
    size = np.linalg.norm(log["wrench"][:, :3], axis=1)
    assert not size[time <= TAKES].any()
    # of the 40 N that it wants; along the tool's axis
    np.testing.assert_allclose(log["wrench"][time > TAKES + RAMP + 2e-3, 2], 30.0, rtol=1e-9)
    assert not log["wrench"][:, :2].any()


def test_it_leads_once_the_plate_hangs():
    time, log = over_time(held=1.0, duration=0.6)
    first = time[np.argmax(log["phase"][:, 0] == MountingPhase.LEAD)]
    assert first == pytest.approx(TAKES, abs=2.0 * PERIOD)
    # until the delay is over it still delivers what it wanted while gripping
    after = (time > first + RAMP) & (time < first + DELAY - 2.0 * PERIOD)
    np.testing.assert_allclose(log["wrench"][after, 2], 30.0, rtol=1e-9)
    later = time > first + DELAY + 2.0 * PERIOD
    assert np.abs(log["wrench"][later, 2]).max() < 29.0


def test_what_it_does_stands_still_while_it_does_not_see_the_tool():
    stepper = Stepper(hand(**SURE).block)
    for _ in range(round(BEGIN / PERIOD) + 10):
        stepper.step(tool_pose=pose(), held=1.0)
    states = stepper.states
    assert states["phase"][0] == MountingPhase.LEAD
    for _ in range(5):
        stepper.step(tool_pose=np.full(12, np.nan), held=1.0)
    for name in ("phase", "since", "clock", "force", "torque", "deepest", "when"):
        assert np.array_equal(stepper.states[name], states[name])
    assert not stepper.states["wrench"].any()


@pytest.mark.parametrize(("share", "phase"), [(0.4, "INSERT"), (0.6, "ALIGN")])
def test_half_the_gap_that_it_sees_is_close_enough(share, phase):
    """An eye that makes no errors takes a plate within half of its gap for aligned."""
    operator = hand(**SURE, eye_gap=2e-3)
    hover = operator.block._mounting.hover
    state = operator.start(phase=float(MountingPhase.ALIGN))
    where = pose(-PINS - hover, beside=(share * 2e-3, 0.0))
    state, _ = go(operator, state, END, 0.05, where)
    assert operator.phase(state).name == phase
