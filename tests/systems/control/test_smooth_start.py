"""A reference that starts where the tool is."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from pfsc_drake.control.law.transition import Transition
from pfsc_drake.systems.control.smooth_start import SmoothStart

WANTED = np.array([0.5, 0.0, 0.1, 0.0, 0.0, 0.0])  # of two outputs with two derivatives
PERIOD = 1e-3
ACTUAL = np.array([0.52, -0.01, 0.0, 0.0])


def _start(actual=ACTUAL, begin=0.0):
    """Return the reference's value at the present and what advances a simulation."""
    builder = DiagramBuilder()
    start = builder.AddSystem(SmoothStart(0.2, 2, 2, 4, PERIOD))
    for name, value in (("desired_reference", WANTED), ("manifold_state", actual)):
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), start.GetInputPort(name))
    simulator = Simulator(builder.Build())
    simulator.get_mutable_context().SetTime(begin)
    simulator.Initialize()

    def reference(time):
        if time > begin:
            simulator.AdvanceTo(time)
        context = start.GetMyContextFromRoot(simulator.get_context())
        return start.GetOutputPort("reference").Eval(context)

    return reference


@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_begins_at_the_tool_and_ends_at_the_reference(begin):
    reference = _start(begin=begin)
    np.testing.assert_allclose(reference(begin), [0.52, -0.01, 0.1, 0, 0, 0], atol=1e-12)
    half = reference(begin + 0.1)
    np.testing.assert_allclose(half[:2], [0.51, -0.005], atol=1e-9)
    assert half[2] < 0.1
    assert half[3] > 0.0
    np.testing.assert_array_equal(reference(begin + 0.2), WANTED)


@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_follows_the_transition_from_tick_to_tick(begin):
    reference, transition = _start(begin=begin), Transition(0.2, 2)
    distance = ACTUAL[:2] - WANTED[:2]
    for tick in range(205):
        time = (round(begin / PERIOD) + tick) * PERIOD
        rest = np.outer(transition.at(time - begin).full(), distance).ravel()
        expected = WANTED + rest if time - begin < 0.2 else WANTED
        np.testing.assert_allclose(reference(time), expected, atol=1e-11)


def test_a_tool_that_is_nowhere_has_no_distance():
    reference = _start(np.array([np.nan, -0.01, 0.0, 0.0]))
    np.testing.assert_allclose(reference(0.0)[:2], [0.5, -0.01], atol=1e-12)
