"""The operator's side of a teleoperation, in a process of its own, in real time."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.lcm import DrakeLcmInterface
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from diagrams.environment.channel_end import ChannelEnd
from diagrams.environment.leader import LeaderSide
from diagrams.scenario import Scenario
from diagrams.scenario_task import make_task
from diagrams.signal_log import add_log
from experiments.finished_run import steady_clock
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from pfsc_drake.checks import require
from pfsc_drake.control.teleoperation.port import RECORD
from pfsc_drake.drivers.teleoperation_link import TeleoperationEnd
from pfsc_drake.systems.fuse import fuse_blocks
from pfsc_drake.yaml.typed import load_typed

_LOOK = 0.1  # s, between looks at what happens


@dataclass(frozen=True)
class Led:
    """What a leader did.

    Attributes:
        duration: How long [s].
        received: Messages of the follower that were heard.
        least_tank: Least energy in its tank [J].
        largest_force: That the hand felt [N].
        way: Farthest that the tool was led from where it starts [m].
    """

    duration: float
    received: int
    least_tank: float
    largest_force: float
    way: float


def lead_scenario(
    scenario: ScenarioFile,
    lcm: DrakeLcmInterface,
    *,
    duration: float | None,
    tell: Callable[[str], None],
) -> Led:
    """Let a scenario's hand hold a leader, whose follower is elsewhere.

    Args:
        scenario: The scenario as read.
        lcm: The bus.
        duration: How long it lasts [s]; None for the scenario's.
        tell: Told in words what happens.

    Raises:
        InputError: If the scenario is wrong, or nothing is led from afar in it.
    """
    settings = load_typed(Scenario, scenario.data, str(scenario.path))
    period = settings.controller.sampling_time
    builder = DiagramBuilder()
    with naming(scenario.path):
        way = settings.teleoperation
        require(way is not None, "teleoperation", "null", "given where somebody leads from afar")
        assert way is not None
        lasts = settings.duration if duration is None else duration
        require(lasts > 0.0, "duration", lasts, "a positive number [s]")
        task = make_task(settings, scenario.path.parent)
        start = task.start(np.zeros(3))
        side = LeaderSide(way, settings.hand, None, task, start, period)
        port, ports = side.add_leader(builder)
    end = TeleoperationEnd(lcm, "leader")
    link = builder.AddNamedSystem("follower_link", ChannelEnd(end, period))
    builder.Connect(port.GetOutputPort("message"), link.GetInputPort("sent"))
    builder.Connect(link.GetOutputPort("arrived"), port.GetInputPort("message"))
    log = add_log(builder, ports, period)
    fuse_blocks(builder)
    simulator = Simulator(builder.Build())
    tell("leading; waiting for a follower")
    simulator.Initialize()
    heard = False
    with steady_clock():
        for time in np.arange(_LOOK, lasts + _LOOK / 2.0, _LOOK):
            simulator.AdvanceTo(min(float(time), lasts))
            if end.received and not heard:
                heard = True
                tell(f"t = {time:.1f} s: a follower is there")
    _, signals = log.read(simulator.get_context())
    record = signals["leader_record"]
    return Led(
        lasts,
        end.received,
        float(record[:, RECORD["tank"]].min()),
        float(np.linalg.norm(signals["leader_motor"], axis=1).max()),
        float(np.linalg.norm(signals["led_point"] - start.target.y_t, axis=1).max()),
    )
