"""A hand on a link as a system: what it remembers."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.physics.link_hand import LinkHandParameters
from pfsc_drake.systems.physics.link_hand import LinkHand

PERIOD = 1e-3
PUSH = LinkHandParameters("link_4", way=[0.0, 0.1, 0.0], begin=0.2, duration=0.3, hold=0.2)


def pushed(positions, times=(0.0, 1.0)):
    """Return the forces [N] on a point that goes straight from place to place, and their times."""
    builder = DiagramBuilder()
    way = PiecewisePolynomial.FirstOrderHold(list(times), np.array(positions, dtype=float).T)
    point = builder.AddSystem(TrajectorySource(way))
    hand = builder.AddSystem(LinkHand(PUSH, PERIOD))
    builder.Connect(point.get_output_port(), hand.get_input_port())
    log = LogVectorOutput(hand.get_output_port(), builder, PERIOD)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    data = log.FindLog(simulator.get_context())
    assert not data.data()[3:].any()
    return data.sample_times(), data.data()[:3].T


def test_the_way_begins_where_the_point_was_then():
    time, force = pushed([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    assert not force[time <= 0.2].any()
    k = np.flatnonzero(np.isclose(time, 0.6))[0]
    # the output at 0.6 s is what was seen a tick before
    expected = [-300 * (0.599 - 0.2) * 0.5 - 30 * 0.5, 300 * 0.1, 0.0]
    expected *= min(1.0, 45.0 / np.linalg.norm(expected)) * np.ones(3)
    assert force[k] == pytest.approx(expected, abs=1e-6)
    assert not force[time > 0.91].any()


def test_a_point_that_is_nowhere_is_let_go():
    nowhere = [[0.0, 0.0, 0.0]] * 2 + [[np.nan] * 3] * 2
    time, force = pushed(nowhere, (0.0, 0.5, 0.501, 1.0))
    assert force[np.isclose(time, 0.49)].any()
    assert not force[time > 0.51].any()
