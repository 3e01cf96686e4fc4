"""The weight of what is held, taken off a wrench."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from scipy.spatial.transform import Rotation

from pfsc_drake.systems.control.payload_compensation import PayloadCompensation

MASS, CENTER, GRAVITY, PERIOD = 0.8, np.array([0.01, -0.02, 0.03]), np.array([0, 0, -9.81]), 1e-3
R = Rotation.from_euler("ZYX", [20.0, 15.0, 170.0], degrees=True)
WRENCH = np.array([1.0, 2.0, 3.0, 0.4, 0.5, 0.6])


def compensated(held, tared, ticks=3):
    """Return the output after some ticks with inputs that may change at every tick."""
    system = PayloadCompensation(MASS, CENTER, GRAVITY, PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    pose = np.concatenate([[0.5, 0.2, 0.7], R.as_matrix().ravel()])
    for name, value in {"wrench": WRENCH, "tool_pose": pose}.items():
        system.GetInputPort(name).FixValue(context, value)
    for k in range(ticks):
        for name, values in {"held": held, "tared": tared}.items():
            value = values[min(k, len(values) - 1)]
            system.GetInputPort(name).FixValue(context, [float(value)])
        simulator.AdvanceTo((k + 1) * PERIOD)
    return system.GetOutputPort("payload_free").Eval(context)


def load(share):
    """Weight of a body that hangs on the tool, about the tool point."""
    force = share * MASS * GRAVITY
    return np.concatenate([force, np.cross(R.apply(CENTER), force)])


def test_nothing_held_changes_nothing():
    np.testing.assert_array_equal(compensated([0], [1]), WRENCH)


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_what_is_held_is_taken_off(share):
    np.testing.assert_allclose(compensated([0, share], [0, 1]), WRENCH - load(share), atol=1e-12)


def test_what_was_tared_is_not_taken_off_twice():
    np.testing.assert_allclose(compensated([1], [0, 0, 1]), WRENCH, atol=1e-12)
    # and once it is gone the bias has its weight, which is given back
    np.testing.assert_allclose(compensated([1, 1, 0], [0, 0, 1]), WRENCH + load(1.0), atol=1e-12)


def test_it_takes_its_inputs_from_a_diagram():
    """Tared, and then gripped: as with inputs that are fixed."""
    builder = DiagramBuilder()
    system = builder.AddSystem(PayloadCompensation(MASS, CENTER, GRAVITY, PERIOD))
    builder.ExportOutput(system.GetOutputPort("payload_free"))
    pose = np.concatenate([[0.5, 0.2, 0.7], R.as_matrix().ravel()])
    steps = {"tared": 0.5 * PERIOD, "held": 2.5 * PERIOD}
    sources = {
        name: TrajectorySource(PiecewisePolynomial.ZeroOrderHold([0.0, at, 1.0], [[0, 1, 1]]))
        for name, at in steps.items()
    }
    sources |= {
        name: ConstantVectorSource(value)
        for name, value in {"wrench": WRENCH, "tool_pose": pose}.items()
    }
    for name, source in sources.items():
        builder.AddSystem(source)
        builder.Connect(source.get_output_port(), system.GetInputPort(name))
    simulator = Simulator(builder.Build())
    output = simulator.get_system().get_output_port()
    simulator.AdvanceTo(2.0 * PERIOD)
    np.testing.assert_array_equal(output.Eval(simulator.get_context()), WRENCH)
    simulator.AdvanceTo(4.0 * PERIOD)
    expected = WRENCH - load(1.0)
    np.testing.assert_allclose(output.Eval(simulator.get_context()), expected, atol=1e-12)
