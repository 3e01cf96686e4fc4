"""A force reference among forces."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, DiagramBuilder

from pfsc_drake.control.compliance.impedance import (
    CoordinateImpedance,
    ImpedanceLaw,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.compliance.press import PressParameters
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.systems.control.impedance_filter import ImpedanceFilter
from pfsc_drake.systems.control.pressing import Pressing

PERIOD = 1e-3


def _force(time, touch_down, lifted):
    return 2.0 * time if touch_down == math.inf else 100.0 + touch_down


def test_it_acts_against_its_coordinate():
    system = Pressing(_force, 1e3, coordinate=2, num_outputs=5, reference_size=5, period=PERIOD)
    context = system.CreateDefaultContext()
    force = np.arange(5.0)
    system.GetInputPort("manifold_force").FixValue(context, force)
    context.SetTime(1.5)
    pressed = system.GetOutputPort("pressed_force").Eval(context)
    np.testing.assert_allclose(pressed, [0.0, 1.0, -1.0, 3.0, 4.0])
    assert system.GetOutputPort("press").Eval(context) == [3.0]


def test_it_keeps_the_time_of_touch_down():
    """Not before the sensor is tared, once, and for good."""
    system = Pressing(_force, 3.0, coordinate=0, num_outputs=1, reference_size=1, period=PERIOD)
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
    system = Pressing(_force, 3.0, coordinate=0, num_outputs=1, reference_size=1, period=PERIOD)
    assert not system.HasDirectFeedthrough(0, system.GetOutputPort("press").get_index())


@pytest.mark.parametrize(("measured", "lost"), [(-14.9, 0), (-15.1, 1), (24.9, 0), (25.1, 1)])
def test_a_force_far_from_its_reference_is_lost_either_way(measured, lost):
    """5 N are asked for; nothing is lost before the sensor is tared."""
    system = Pressing(lambda time, touch_down, lifted: 5.0, 3.0, 1, 2, 2, PERIOD, allowed=20.0)
    context = system.CreateDefaultContext()
    system.GetInputPort("manifold_force").FixValue(context, [1e3, measured])
    ready = system.GetInputPort("ready").FixValue(context, [1.0])
    assert system.GetOutputPort("lost").Eval(context) == [lost]
    ready.GetMutableData().set_value(BasicVector([0.0]))
    assert system.GetOutputPort("lost").Eval(context) == [0.0]


@pytest.mark.parametrize("left", [-0.5, 0.0, 0.5])
def test_a_tool_that_is_taken_off_stays_there(left):
    """Led by its filter alone, for long, with what taring left of the sensor's bias."""
    mass, damping, end, clearance = 6.0, 500.0, 1.0, 0.01
    press = PressParameters(force=0.0, approach=0.0, retreat=10.0, clearance=clearance, limit=15.0)
    across = CoordinateImpedance(Profile(mass), Profile(damping), Profile(0.0))
    coordinates = SurfaceManifold(2).coordinates
    law = ImpedanceLaw(ImpedanceParameters(transversal=across), coordinates, 2, PERIOD)
    builder = DiagramBuilder()
    impedance = builder.AddSystem(ImpedanceFilter(law))
    reference = impedance.GetOutputPort("reference")
    pressing = builder.AddSystem(
        Pressing(
            press.over_time(end, damping**2 / (4.0 * mass)),
            press.touching,
            2,
            3,
            reference.size(),
            PERIOD,
            off=press.taken_off(end),
        )
    )
    builder.Connect(reference, pressing.GetInputPort("reference"))
    builder.Connect(
        pressing.GetOutputPort("pressed_force"), impedance.GetInputPort("manifold_force")
    )
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    given = (("desired_reference", np.zeros(9)), ("manifold_state", np.zeros(6)))
    for name, value in given:
        impedance.GetInputPort(name).FixValue(impedance.GetMyMutableContextFromRoot(root), value)
    context = pressing.GetMyMutableContextFromRoot(root)
    pressing.GetInputPort("manifold_force").FixValue(context, [0.0, 0.0, left])
    pressing.GetInputPort("ready").FixValue(context, [1.0])

    def place():
        return reference.Eval(impedance.GetMyContextFromRoot(root))[2]

    simulator.AdvanceTo(press.taken_off(end))
    before = place()
    assert before == pytest.approx(left * press.taken_off(end) / damping, abs=2e-5)
    highest = 0.0
    while root.get_time() < 5.0:
        simulator.AdvanceTo(root.get_time() + 0.02)
        highest = max(highest, place())
    spring = 2.0 * press.retreat / clearance
    assert place() - before == pytest.approx(clearance + left / spring, abs=1e-5)
    assert highest <= place() + 1e-6, "it does not swing"
