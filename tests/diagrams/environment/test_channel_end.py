"""Two stations' ends that talk to each other, each by its own clock."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from diagrams.environment.channel_end import ChannelEnd
from pfsc_drake.blocks.wiring_blocks import Constant
from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint
from pfsc_drake.systems.block_system import BlockSystem


class Wall:
    """A clock that goes on while one sleeps."""

    def __init__(self):
        self.now = 50.0

    def sleep(self, seconds):
        self.now += seconds


def message(count, felt):
    fields = np.zeros(MESSAGE)
    fields[0], fields[FIELDS["felt"]] = count, [*felt, 0, 0, 0]
    return fields


def station(lcm, side, message, wall, **options):
    builder = DiagramBuilder()
    end = ChannelEnd(
        TeleoperationEndpoint(lcm, side), 1e-3, lambda: wall.now, wall.sleep, **options
    )
    builder.AddNamedSystem("end", end)
    source = builder.AddSystem(BlockSystem(Constant(message), 1e-3))
    builder.Connect(source.get_output_port(), end.GetInputPort("sent"))
    builder.ExportOutput(end.GetOutputPort("arrived"), "arrived")
    return Simulator(builder.Build())


def test_each_side_has_the_others_message_of_the_tick_before():
    lcm, wall = DrakeLcm("memq://"), Wall()
    leader = station(lcm, "leader", message(1.0, [4, 5, 6]), wall)
    follower = station(lcm, "follower", message(3.0, [7, 8, 9]), wall)
    for time in (0.001, 0.002, 0.003):
        leader.AdvanceTo(time)
        follower.AdvanceTo(time)
    for side, count, felt in ((leader, 3.0, [7, 8, 9]), (follower, 1.0, [4, 5, 6])):
        arrived = side.get_system().get_output_port().Eval(side.get_context())
        assert arrived[0] == count
        np.testing.assert_array_equal(arrived[FIELDS["felt"]][:3], felt)


def test_it_goes_with_the_clock():
    wall = Wall()
    simulator = station(DrakeLcm("memq://"), "leader", np.zeros(MESSAGE), wall)
    simulator.AdvanceTo(0.25)
    assert wall.now - 50.0 == pytest.approx(0.25, abs=1.5e-3)
    wall.now += 1.0  # what is late by so much is not caught up
    simulator.AdvanceTo(0.5)
    assert wall.now - 50.0 == pytest.approx(1.5, abs=5e-3)


def test_where_something_else_makes_time_go_it_does_not_wait():
    wall = Wall()
    simulator = station(DrakeLcm("memq://"), "leader", np.zeros(MESSAGE), wall, paced=False)
    simulator.AdvanceTo(0.25)
    assert wall.now == 50.0
