"""A force reference among forces."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector

from pfsc_drake.systems.control.pressing import Pressing


def _force(time, touch_down):
    return 2.0 * time if touch_down == math.inf else 100.0 + touch_down


def test_it_acts_against_its_coordinate():
    system = Pressing(_force, 1e3, coordinate=2, num_outputs=5, period=1e-3)
    context = system.CreateDefaultContext()
    force = np.arange(5.0)
    system.GetInputPort("manifold_force").FixValue(context, force)
    context.SetTime(1.5)
    pressed = system.GetOutputPort("pressed_force").Eval(context)
    np.testing.assert_allclose(pressed, [0.0, 1.0, -1.0, 3.0, 4.0])
    assert system.GetOutputPort("press").Eval(context) == [3.0]


def test_it_keeps_the_time_of_touch_down():
    """Not before the sensor is tared, once, and for good."""
    system = Pressing(_force, 3.0, coordinate=0, num_outputs=1, period=1e-3)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    measured, ready = (
        system.GetInputPort(name).FixValue(context, [value])
        for name, value in (("manifold_force", 50.0), ("ready", 0.0))
    )

    def press_at(time):
        simulator.AdvanceTo(time)
        return system.GetOutputPort("press").Eval(context).item()

    assert press_at(0.0105) == pytest.approx(0.021)
    ready.GetMutableData().set_value(BasicVector([1.0]))
    measured.GetMutableData().set_value(BasicVector([2.9]))
    assert press_at(0.0205) == pytest.approx(0.041)
    measured.GetMutableData().set_value(BasicVector([3.0]))
    assert press_at(0.0305) == pytest.approx(100.021)
    measured.GetMutableData().set_value(BasicVector([0.0]))
    assert press_at(0.0505) == pytest.approx(100.021)


def test_the_reference_needs_no_force():
    system = Pressing(_force, 3.0, coordinate=0, num_outputs=1, period=1e-3)
    assert not system.HasDirectFeedthrough(0, system.GetOutputPort("press").get_index())


@pytest.mark.parametrize(("measured", "lost"), [(-14.9, 0), (-15.1, 1), (24.9, 0), (25.1, 1)])
def test_a_force_far_from_its_reference_is_lost_either_way(measured, lost):
    """5 N are asked for; nothing is lost before the sensor is tared."""
    system = Pressing(lambda time, touch_down: 5.0, 3.0, 1, 2, 1e-3, allowed=20.0)
    context = system.CreateDefaultContext()
    system.GetInputPort("manifold_force").FixValue(context, [1e3, measured])
    ready = system.GetInputPort("ready").FixValue(context, [1.0])
    assert system.GetOutputPort("lost").Eval(context) == [lost]
    ready.GetMutableData().set_value(BasicVector([0.0]))
    assert system.GetOutputPort("lost").Eval(context) == [0.0]
