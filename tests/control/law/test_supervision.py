"""Which measured value of a joint is wrong: from motions that are known."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.supervision import Supervision, SupervisionParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

PERIOD, N = 1e-3, 3
TIMES = PERIOD * np.arange(800)
BEGIN = 400
NAMES = ("q_J", "v_J", "q_M", "v_M")


@pytest.fixture(scope="module", params=["comau_racer_1_4_elastic_3r", "comau_racer_1_4_3r"])
def chain(request):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(request.param)))
    plant.Finalize()
    return chain_from_plant(plant, plant.GetFrameByName("tool_point"))[0]


def motion(chain):
    """Return states of joints that swing, the springs of elastic ones bent by 500 Nm and back."""
    rate = np.array([3.0, 4.0, 5.0])
    angle = rate * TIMES[:, None]
    q, v = 0.4 * np.sin(angle) + [0.0, 1.0, 0.0], 0.4 * rate * np.cos(angle)
    bend = np.where(np.isfinite(chain.K_s), 500.0 / chain.K_s, 0.0)
    swing = 30.0 * TIMES[:, None]
    q_M, v_M = q + bend * np.sin(swing), v + 30.0 * bend * np.cos(swing)
    return np.hstack([q, v, q_M, v_M])


def watch(chain, states, ignored=None, **options):
    """Return the first tick with a fault, the fault, and the suspects by name."""
    limits = chain.gather("effort_limit")
    watching = Stepper(Supervision(chain, limits, SupervisionParameters(**options), PERIOD))
    ignored = np.zeros(4 * N) if ignored is None else ignored
    for k, state in enumerate(states):
        result = watching.step(joint_state=state, ignored=ignored)
        if result["fault"]:
            found = np.flatnonzero(result["suspects"])
            return (
                k,
                Fault(int(result["fault"][0])),
                [f"{NAMES[i // N]}_{i % N + 1}" for i in found],
            )
    return None


def test_a_true_motion_is_believed(chain):
    assert watch(chain, motion(chain)) is None


@pytest.mark.parametrize("component", range(4 * N))
@pytest.mark.parametrize("kind", ["jump", "frozen"])
def test_what_is_wrong_is_found(chain, component, kind):
    states = motion(chain)
    if kind == "jump":
        size = 0.01 if component // N % 2 == 0 else 0.5
        states[BEGIN:, component] += size
    else:
        states[BEGIN:, component] = states[BEGIN, component]
    k, fault, suspects = watch(chain, states)
    assert fault is Fault.MEASUREMENT_IMPLAUSIBLE
    assert suspects == [f"{NAMES[component // N]}_{component % N + 1}"]
    if kind == "jump":
        # a position at once, a velocity when 2 mrad are integrated
        assert k == BEGIN if size == 0.01 else BEGIN + 3 <= k <= BEGIN + 6
    assert BEGIN <= k < BEGIN + 150


def test_what_cannot_be_found(chain):
    """Frozen at rest; a drift below the tolerance times the rate of forgetting; by intent."""
    resting = np.tile(motion(chain)[0] * np.repeat([1, 0, 1, 0], N), (800, 1))
    assert watch(chain, resting) is None
    drifting = motion(chain)
    drifting[:, 1] += 0.9 * 2e-3 * 20.0 * TIMES
    assert watch(chain, drifting) is None
    drifting[:, 1] += 0.3 * 2e-3 * 20.0 * TIMES
    assert watch(chain, drifting)[1] is Fault.MEASUREMENT_IMPLAUSIBLE
    jumped = motion(chain)
    jumped[BEGIN:, 0] += 1.0
    assert watch(chain, jumped, tolerance=0.0) is None


def test_coarse_and_late_measurements_are_believed(chain):
    """Steps of 3 mrad, and velocities that a filter of 20 ms delays."""
    states, step, time = motion(chain), 3e-3, 0.02
    late = states.copy()
    for side in (slice(0, N), slice(2 * N, 3 * N)):
        late[:, side] = step * np.round(states[:, side] / step)
    weight = 1.0 - np.exp(-PERIOD / time)
    for k in range(1, len(late)):
        for side in (slice(N, 2 * N), slice(3 * N, 4 * N)):
            late[k, side] = late[k - 1, side] + weight * (states[k, side] - late[k - 1, side])
    assert watch(chain, late) is not None
    assert watch(chain, late, resolution=np.array([step]), filter_time=time) is None


def slow_motion(speed):
    """Return states of joint 1 that rests, and sets off after half of the time."""
    way = speed * PERIOD * np.maximum(np.arange(1600) - 800, 0)
    states = np.zeros((1600, 4 * N))
    states[:, [0, 2 * N]] = way[:, None]
    # difference quotients
    states[1:, [N, 3 * N]] = np.diff(way)[:, None] / PERIOD
    return states


@pytest.mark.parametrize("filter_time", [PERIOD, 10.0 * PERIOD])
@pytest.mark.parametrize(("side", "name"), [(0, "q_J_1"), (2 * N, "q_M_1")])
def test_an_encoder_that_froze_at_rest_is_found_by_the_tolerance(chain, filter_time, side, name):
    """At 0.03 rad/s, though joints may move at 4 rad/s: velocities are late by a slow motion."""
    speed = 0.03
    frozen = slow_motion(speed)
    assert watch(chain, frozen, joint_limits=False, filter_time=filter_time) is None
    frozen[:, side] = 0.0
    k, fault, suspects = watch(chain, frozen, joint_limits=False, filter_time=filter_time)
    assert (fault, suspects) == (Fault.MEASUREMENT_IMPLAUSIBLE, [name])
    way = (k - 800) * PERIOD * speed
    assert 2e-3 < way < 1.15 * (2e-3 + 2.0 * filter_time * speed)


@pytest.mark.parametrize(("bias", "believed"), [(3e-3, True), (5e-3, False)])
def test_a_resting_position_beside_a_velocity_that_is_off(chain, bias, believed):
    """Up to the tolerance times 2 1/s, an offset of a velocity is no motion."""
    states = np.zeros((4000, 4 * N))
    states[:, N + 1] = bias
    assert (watch(chain, states, joint_limits=False) is None) == believed


def test_coarse_encoders_are_believed(chain):
    """Positions in steps of 4 mrad beside exact velocities part by more than the tolerance."""
    coarse, step = motion(chain), 4e-3
    for side in (slice(0, N), slice(2 * N, 3 * N)):
        coarse[:, side] = step * np.round(coarse[:, side] / step)
    assert watch(chain, coarse) is not None
    assert watch(chain, coarse, resolution=np.array([step])) is None


def test_what_is_ignored_is_not_suspected_again(chain):
    """The link side of joint 3 is frozen; its position is not listened to any more."""
    if np.isinf(chain.K_s).all():
        pytest.skip("of rigid joints one side is the other")
    states = motion(chain)
    states[BEGIN:, [2, N + 2]] = states[BEGIN, 2], 0.0
    assert watch(chain, states)[2] == ["q_J_3", "v_J_3"]
    ignored = np.eye(4 * N)[2]
    assert watch(chain, states, ignored=ignored)[2] == ["v_J_3"]


@pytest.mark.parametrize("too_fast", [1.09, 1.11])
def test_a_joint_beyond_its_largest_speed(chain, too_fast):
    """Joint 2 turns steadily, faster than it may by 9 or by 11 percent."""
    speed = too_fast * chain.gather("velocity_limit")[1]
    states = np.zeros((100, 4 * N))
    for side in (0, 2 * N):
        states[:, side + 1], states[:, side + N + 1] = speed * PERIOD * np.arange(100), speed
    found = watch(chain, states, joint_limits=False)
    assert found == (None if too_fast < 1.1 else (1, Fault.JOINT_SPEED, []))
    assert watch(chain, states, joint_limits=False, overspeed=np.inf) is None
    assert watch(chain, states, joint_limits=False, overspeed=0.0)[1] is Fault.JOINT_SPEED


def test_a_velocity_that_jumps_beyond_the_limit_is_a_sensor_to_blame(chain):
    """Only the sensor says so; the positions show that the joint is slower."""
    states = motion(chain)
    states[BEGIN:, N + 1] += 1.2 * chain.gather("velocity_limit")[1]
    _, fault, suspects = watch(chain, states)
    assert (fault, suspects) == (Fault.MEASUREMENT_IMPLAUSIBLE, ["v_J_2"])


def test_values_that_are_no_numbers_are_for_others_to_find(chain):
    states = motion(chain)
    states[BEGIN:, 7] = np.nan
    assert watch(chain, states) is None


@pytest.mark.parametrize("side", [0, 1])
def test_joint_limits(chain, side):
    states = motion(chain)
    limit = chain.gather("position_limits")[1, side]
    offset = limit - (states[:, 1].max() if side else states[:, 1].min())
    for column in (1, 7):
        states[:, column] += offset
    k, fault, suspects = watch(chain, states)
    assert (fault, suspects) == (Fault.JOINT_LIMIT, [])
    assert states[k, 1] == limit
    assert watch(chain, states, joint_limits=False) is None


def test_wrong_parameters_are_refused(chain):
    with pytest.raises(InputError, match="tolerance = -1"):
        SupervisionParameters(tolerance=-1.0)
    with pytest.raises(InputError, match="overspeed = nan"):
        SupervisionParameters(overspeed=np.nan)
    with pytest.raises(InputError, match=r"resolution.*3 joints"):
        watch(chain, motion(chain), resolution=np.ones(2))
