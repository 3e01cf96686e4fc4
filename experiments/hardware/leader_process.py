"""Leader side of a teleoperation in a separate process, in real time."""

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
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint
from pfsc_drake.systems.fuse import fuse_blocks
from pfsc_drake.yaml.typed import load_typed

_LOOK = 0.1  # s, between checks for messages


@dataclass(frozen=True)
class LeaderSummary:
    """Summary of a leader's run.

    Attributes:
        duration: Duration [s].
        received: Number of messages received from the follower.
        least_tank: Least energy in its tank [J].
        largest_force: Largest force on the operator [N].
        travel: Largest distance of the commanded point from its start [m].
    """

    duration: float
    received: int
    least_tank: float
    largest_force: float
    travel: float


def lead_scenario(
    scenario: ScenarioFile,
    lcm: DrakeLcmInterface,
    *,
    duration: float | None,
    notify: Callable[[str], None],
) -> LeaderSummary:
    """Simulate the operator and the leader device of a scenario; the follower is another process.

    Args:
        scenario: The scenario as read.
        lcm: The bus.
        duration: Duration [s]; None for the scenario's.
        notify: Receives lines about events.

    Raises:
        InputError: If the scenario is wrong, or has no teleoperation.
    """
    settings = load_typed(Scenario, scenario.data, scenario.source)
    period = settings.controller.sampling_time
    builder = DiagramBuilder()
    with naming(scenario.source):
        coupling = settings.teleoperation
        require(coupling is not None, "teleoperation", "null", "a teleoperation, as in teleop_path")
        assert coupling is not None
        lasts = settings.duration if duration is None else duration
        require(lasts > 0.0, "duration", lasts, "a positive number [s]")
        task = make_task(settings, scenario.path.parent)
        start = task.start(np.zeros(3))
        side = LeaderSide(coupling, settings.hand, None, task, start, period)
        port, ports = side.add_leader(builder)
    end = TeleoperationEndpoint(lcm, "leader")
    link = builder.AddNamedSystem("follower_link", ChannelEnd(end, period))
    builder.Connect(port.GetOutputPort("message"), link.GetInputPort("sent"))
    builder.Connect(link.GetOutputPort("arrived"), port.GetInputPort("message"))
    log = add_log(builder, ports, period)
    fuse_blocks(builder)
    simulator = Simulator(builder.Build())
    notify("leader ready; waiting for a follower")
    simulator.Initialize()
    heard = False
    with steady_clock():
        for time in np.arange(_LOOK, lasts + _LOOK / 2.0, _LOOK):
            simulator.AdvanceTo(min(float(time), lasts))
            if end.received and not heard:
                heard = True
                notify(f"t = {time:.1f} s: follower connected")
    _, signals = log.read(simulator.get_context())
    record = signals["leader_record"]
    return LeaderSummary(
        lasts,
        end.received,
        float(record[:, RECORD["tank"]].min()),
        float(np.linalg.norm(signals["leader_motor"], axis=1).max()),
        float(np.linalg.norm(signals["led_point"] - start.target.y_t, axis=1).max()),
    )
