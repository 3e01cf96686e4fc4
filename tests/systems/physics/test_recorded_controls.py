"""Controls, played back."""

import numpy as np

from pfsc_drake.systems.physics.operator_panel import RecordedControls

PERIOD = 1e-3


def test_a_row_holds_from_its_tick_to_the_next_whatever_rounding_does():
    ticks = np.array([0, 3, 4, 1001, 5000])
    rows = np.arange(10.0).reshape(5, 2)
    system = RecordedControls(ticks, rows, PERIOD)
    context = system.CreateDefaultContext()
    expected = np.repeat(np.arange(5), np.diff(np.append(ticks, 6000)))
    for tick in range(6000):
        for time in (tick * PERIOD, np.nextafter(tick * PERIOD, 0.0)):
            context.SetTime(time)
            row = system.GetOutputPort("controls").Eval(context)
            assert row[0] == rows[expected[tick], 0]
