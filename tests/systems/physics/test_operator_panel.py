"""Controls, sampled."""

import numpy as np
from pydrake.systems.analysis import Simulator

from pfsc_drake.systems.physics.operator_panel import OperatorPanel

PERIOD = 1e-3
PARTS = {"pull": np.zeros(2), "request": np.array([-1.0])}


def test_controls_count_from_the_next_tick_on():
    system = OperatorPanel(PARTS, PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()

    def samples():
        ports = (system.GetOutputPort(name) for name in PARTS)
        return np.concatenate([port.Eval(context) for port in ports]).tolist()

    simulator.AdvanceTo(2 * PERIOD)
    assert samples() == [0.0, 0.0, -1.0]  # nobody is there
    system.GetInputPort("controls").FixValue(context, [1.0, 2.0, 3.0])
    assert samples() == [0.0, 0.0, -1.0]
    simulator.AdvanceTo(2.5 * PERIOD)
    assert samples() == [1.0, 2.0, 3.0]
    system.GetInputPort("controls").FixValue(context, [4.0, 5.0, 6.0])
    simulator.AdvanceTo(2.9 * PERIOD)
    assert samples() == [1.0, 2.0, 3.0]
