"""Sensor failures: NaN, frozen, or in error."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import SensorFailure
from pfsc_drake.systems.block_system import BlockSystem

T = 1e-3


class Clock(LeafSystem):
    """Sends ``[t, 2 t, 3 t]``."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorOutputPort("out", 3, self._calc)

    def _calc(self, context, output):
        output.SetFromVector(context.get_time() * np.array([1.0, 2.0, 3.0]))


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [("nan", lambda t: np.nan), ("frozen", lambda t: 4.0 * T), ("jump", lambda t: 2.0 * t + 0.5)],
)
def test_kinds(kind, wrong):
    builder = DiagramBuilder()
    clock = builder.AddSystem(Clock())
    failure = builder.AddSystem(BlockSystem(SensorFailure(3, [1], 2.5 * T, T, kind, 0.5), T))
    builder.Connect(clock.get_output_port(), failure.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    for k in range(6):
        t = k * T
        simulator.AdvanceTo(t)
        context = failure.GetMyContextFromRoot(simulator.get_context())
        expected = [t, 2.0 * t if k < 3 else wrong(t), 3.0 * t]
        np.testing.assert_allclose(failure.get_output_port().Eval(context), expected, atol=1e-12)


def test_a_kind_that_does_not_exist():
    with pytest.raises(InputError, match="'odd'; must be nan, frozen, jump"):
        SensorFailure(3, [1], 0.0, T, "odd")
