"""Brakes that close after a fault, on an inertia that its load drives."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Integrator,
    LogVectorOutput,
    MatrixGain,
    Multiplexer,
    TrajectorySource,
)
from pydrake.trajectories import PiecewisePolynomial

from experiments.simulation import configure
from pfsc_drake.physics.friction import bristles_for_step
from pfsc_drake.physics.holding_brakes import HoldingBrakes
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.brake_torque import BrakeTorque

INERTIA, HOLDING = 2.0, 50.0  # kg m^2, Nm
FAULT, DELAY, TICK = 0.1, 0.05, 1e-3  # s


def _velocity(load, fault=FAULT, end=0.6, requested=0):
    """Return times [s] and velocity [rad/s] of an inertia that a load [Nm] drives from rest."""
    builder = DiagramBuilder()
    friction = bristles_for_step(np.array([HOLDING]), np.zeros(1), np.array([INERTIA]), TICK)
    block = HoldingBrakes(friction.presliding, 2, DELAY, TICK)
    brakes = builder.AddSystem(BlockSystem(block, TICK))
    braked = builder.AddSystem(BrakeTorque(friction))
    motor = builder.AddSystem(Integrator(1))
    angle = builder.AddSystem(Integrator(1))
    # one rigid joint, whose links rest where the brakes do not look
    joint_state = builder.AddSystem(Multiplexer(4))
    elsewhere = builder.AddSystem(ConstantVectorSource([7.0]))
    inertia = builder.AddSystem(MatrixGain(np.array([[1.0 / INERTIA]])))
    torque = builder.AddSystem(Adder(2, 1))
    weight = builder.AddSystem(ConstantVectorSource([load]))
    steps = PiecewisePolynomial.ZeroOrderHold([0.0, fault, 10.0], np.array([[-1.0, 0.0, 0.0]]))
    status = builder.AddSystem(TrajectorySource(steps))
    builder.Connect(weight.get_output_port(), torque.get_input_port(0))
    builder.Connect(braked.GetOutputPort("resistance"), torque.get_input_port(1))
    builder.Connect(torque.get_output_port(), inertia.get_input_port())
    builder.Connect(inertia.get_output_port(), motor.get_input_port())
    builder.Connect(motor.get_output_port(), angle.get_input_port())
    for k, source in enumerate((elsewhere, elsewhere, angle, motor)):
        builder.Connect(source.get_output_port(), joint_state.get_input_port(k))
    for system in (brakes, braked):
        builder.Connect(joint_state.get_output_port(), system.GetInputPort("joint_state"))
    for name in ("anchor", "give"):
        builder.Connect(brakes.GetOutputPort(name), braked.GetInputPort(name))
    never = builder.AddSystem(ConstantVectorSource([2.0]))
    for k in range(2):
        source = status if k == requested else never
        builder.Connect(source.get_output_port(), brakes.GetInputPort(f"request_{k}"))
    log = LogVectorOutput(motor.get_output_port(), builder, TICK)
    simulator = Simulator(builder.Build())
    configure(simulator, "runge_kutta3", TICK)
    simulator.AdvanceTo(end)
    found = log.FindLog(simulator.get_context())
    return found.sample_times(), found.data()[0]


def test_nothing_holds_before_they_close():
    t, v = _velocity(10.0)
    open_until = FAULT + DELAY
    np.testing.assert_allclose(v[t < open_until], 5.0 * t[t < open_until], atol=1e-9)


@pytest.mark.parametrize("requested", [0, 1])
def test_they_stop_what_moves_and_hold_it(requested):
    t, v = _velocity(10.0, requested=requested)
    # closed, they take away (50 - 10) / 2 rad/s each second
    closed = FAULT + DELAY + 0.02
    start = v[np.searchsorted(t, closed)]
    stopped = closed + start / 20.0
    assert v[t > stopped + 0.02] == pytest.approx(0.0, abs=1e-6)
    moving = (t > closed + 0.002) & (t < stopped - 0.005)
    np.testing.assert_allclose(v[moving], start - 20.0 * (t[moving] - closed), atol=0.03)


def test_a_load_above_the_holding_torque_slips():
    t, v = _velocity(60.0)
    slope = np.diff(v[t > 0.3]) / TICK
    np.testing.assert_allclose(slope, (60.0 - HOLDING) / INERTIA, rtol=1e-6)


def test_without_request_they_stay_open():
    t, v = _velocity(10.0, fault=9.0)
    np.testing.assert_allclose(v, 5.0 * t, atol=1e-9)
