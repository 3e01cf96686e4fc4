"""A recorded drawing, for a slow receiver."""

import numpy as np
import pytest

from pfsc_drake.systems.physics.operator_panel import RecordedPen

PERIOD, LENGTH = 2e-3, 2
TICKS = np.array([0, 3, 3, 5, 6, 6])
# how many waypoints; the last message is the end of the line
TOTALS = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.0])


@pytest.mark.parametrize(
    ("tick", "taken", "row"),
    [(0, 0, 0), (2, 0, 0), (3, 0, 2), (5, 0, 2), (5, 1, 3), (6, 1, 3), (6, 2, 5), (99, 0, 2)],
)
def test_a_waypoint_comes_at_its_time_if_there_is_space(tick, taken, row):
    messages = np.column_stack([TOTALS, np.arange(6.0)])
    pen = RecordedPen(TICKS, messages, LENGTH, PERIOD)
    context = pen.CreateDefaultContext()
    context.SetTime(tick * PERIOD)
    pen.get_input_port().FixValue(context, [1.0, float(taken), 0.1, 0.2])
    np.testing.assert_array_equal(pen.get_output_port().Eval(context), messages[row])
