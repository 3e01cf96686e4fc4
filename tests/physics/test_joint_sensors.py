"""Sensors of joints: position encoders, and torque sensors of elastic joints."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.joint_sensors import EncoderOptions, JointEncoders
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.systems.block_system import BlockSystem

T = 1e-3
EYE, ZERO, Z = np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0])
CHAIN = SerialChain(
    tuple(ChainLink(k, k, EYE, ZERO, Z, 1.0, ZERO, EYE) for k in ("revolute", "prismatic"))
)


def true_state(t):
    """``[q_J, v_J, q_M, v_M]`` of a smooth motion."""
    q, v = np.array([np.sin(3.0 * t), 0.2 * t]), np.array([3.0 * np.cos(3.0 * t), 0.2])
    return np.concatenate([q, v, 1.01 * q, 1.01 * v])


class Motion(LeafSystem):
    """Sends :func:`true_state`."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorOutputPort("joint_state", 8, self._calc)

    def _calc(self, context, output):
        output.SetFromVector(true_state(context.get_time()))


def measure(options, duration=0.2, start=0.0):
    """Return times and measured joint states of the motion."""
    builder = DiagramBuilder()
    motion = builder.AddSystem(Motion())
    encoders = builder.AddSystem(BlockSystem(JointEncoders(CHAIN, options, T), T))
    builder.Connect(motion.get_output_port(), encoders.GetInputPort("joint_state"))
    sink = LogVectorOutput(encoders.GetOutputPort("joint_state"), builder, T)
    simulator = Simulator(builder.Build())
    simulator.get_mutable_context().SetTime(start)
    simulator.AdvanceTo(start + duration)
    log = sink.FindLog(simulator.get_context())
    return log.sample_times(), log.data().T, simulator, encoders


def test_exact_without_options():
    encoders = JointEncoders(CHAIN, EncoderOptions(), T)
    assert not encoders.states
    state = np.random.default_rng(1).normal(size=8)
    assert np.array_equal(Stepper(encoders).step(joint_state=state)["joint_state"], state)


def test_resolution():
    """1,000 increments per revolution and per metre; the motor's encoder finer."""
    t, measured, *_ = measure(EncoderOptions([1000.0], [1e5, 0.0]))
    true = np.array([true_state(x) for x in t])
    steps = measured[:, :2] / [2.0 * np.pi / 1000.0, 1e-3]
    assert np.allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    error = np.abs(measured - true)
    assert np.all(error[:, 0] <= np.pi / 1000.0 + 1e-12) and np.max(error[:, 0]) > 3e-3
    assert np.all(error[:, 1] <= 0.5e-3 + 1e-12) and np.max(error[:, 1]) > 4e-4
    assert 0.0 < np.max(error[:, 4]) <= np.pi / 1e5 + 1e-12
    # velocities and the motor encoder without resolution are exact
    assert np.array_equal(measured[:, [2, 3, 5, 6, 7]], true[:, [2, 3, 5, 6, 7]])


def test_halves_are_rounded_to_even():
    """As numpy does."""
    encoders = Stepper(JointEncoders(CHAIN, EncoderOptions([0.0, 1.0], [1.0]), T))
    random = np.random.default_rng(0)
    for x in [*np.arange(-3.5, 4.0, 0.5), 0.49999999999999994, 1e17 + 2.0, *random.normal(size=9)]:
        state = np.array([0.3, x, 0.0, 0.0, x * 2.0 * np.pi, -x, 0.0, 0.0])
        q_J, q_M = encoders.step(joint_state=state)["joint_state"].reshape(4, 2)[[0, 2]]
        assert q_J.tolist() == [0.3, np.rint(x)]
        assert q_M[1] == np.rint(-x)


@pytest.mark.parametrize("increments", [[], [5000.0]])
def test_difference_quotient(increments):
    options = EncoderOptions(increments, increments, difference_quotient=True)
    t, measured, *_ = measure(options)
    true = np.array([true_state(x) for x in t])
    r = np.array([2.0 * np.pi / 5000.0, 1.0 / 5000.0])
    q = true[:, [0, 1, 4, 5]]
    q = np.tile(r, 2) * np.round(q / np.tile(r, 2)) if increments else q
    assert np.allclose(measured[:, [0, 1, 4, 5]], q, rtol=0, atol=1e-15)
    assert np.allclose(measured[1:, [2, 3, 6, 7]], np.diff(q, axis=0) / T, rtol=0, atol=1e-9)
    assert np.array_equal(measured[0, [2, 3, 6, 7]], true[0, [2, 3, 6, 7]])


def test_filter():
    """The recurrence by hand, and a ramp's velocity without steady error."""
    tau = 5e-3
    t, measured, *_ = measure(EncoderOptions(difference_quotient=True, filter_time=tau))
    true = np.array([true_state(x) for x in t])
    v = true[0, 2]
    for k in range(1, len(t)):
        v += (1.0 - np.exp(-T / tau)) * ((true[k, 0] - true[k - 1, 0]) / T - v)
        assert np.isclose(measured[k, 2], v, rtol=0, atol=1e-9)
    assert np.isclose(measured[-1, 3], 0.2, rtol=0, atol=1e-9)


def test_velocity_is_constant_between_ticks():
    _, _, simulator, encoders = measure(EncoderOptions(difference_quotient=True), 0.01)
    context = encoders.GetMyContextFromRoot(simulator.get_context())
    velocities = []
    for t in (0.0102, 0.0105, 0.0109):
        simulator.AdvanceTo(t)
        velocities.append(encoders.GetOutputPort("joint_state").Eval(context)[2])
    expected = (np.sin(0.03) - np.sin(0.027)) / T
    assert np.allclose(velocities, expected, rtol=0, atol=1e-9)


def test_start_between_two_ticks():
    t, measured, *_ = measure(EncoderOptions(difference_quotient=True), 0.01, start=0.5004)
    true = np.array([true_state(x) for x in t])
    assert np.allclose(measured[:, 2], true[:, 2], rtol=0, atol=0.01)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (
            EncoderOptions([1.0, 2.0, 3.0]),
            r"link_increments = .* must be none, one",
        ),
        (EncoderOptions(motor_increments=[-5.0]), "motor_increments"),
        (EncoderOptions([np.nan]), "link_increments"),
        (EncoderOptions(filter_time=-1.0), "filter_time = -1.0 s"),
    ],
)
def test_wrong_options(options, named):
    with pytest.raises(InputError, match=named) as error:
        JointEncoders(CHAIN, options, T)
    assert "\n" not in str(error.value)


def test_wrong_period():
    with pytest.raises(InputError, match=r"period = 0.0 s"):
        JointEncoders(CHAIN, EncoderOptions(), 0.0)
