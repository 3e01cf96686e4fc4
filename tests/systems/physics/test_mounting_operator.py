"""An operator who mounts a plate, as a system."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from pfsc_drake.physics.hand_model import HandParameters, HandWaypoint
from pfsc_drake.physics.mounting_hand import MountingPhase
from pfsc_drake.physics.mounting_parameters import MountingHandParameters
from pfsc_drake.systems.physics.mounting_operator import MountingOperator

PERIOD, DELAY, BEGIN, RAMP = 1e-3, 0.05, 0.1, 0.02
HAND = HandParameters(
    waypoints=[HandWaypoint(BEGIN, [0.0, 0.0, 0.5]), HandWaypoint(1.0, [0.0, 0.0, 0.6])],
    reaction_delay=DELAY,
    grip_ramp=RAMP,
    force_limit=30.0,
)


def run(held, duration):
    builder = DiagramBuilder()
    goal = np.array([0.3, 0.0, 0.5]), np.eye(3)
    operator = builder.AddSystem(
        MountingOperator(HAND, MountingHandParameters(press=40.0), goal, 0.01, PERIOD)
    )
    pose = np.concatenate([[0.0, 0.0, 0.5], np.eye(3).ravel()])
    for name, value in {"tool_pose": pose, "held": [held]}.items():
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), operator.GetInputPort(name))
    sinks = {
        name: LogVectorOutput(operator.GetOutputPort(name), builder, PERIOD)
        for name in ("wrench", "vacuum", "phase")
    }
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)
    logs = {name: sink.FindLog(simulator.get_context()) for name, sink in sinks.items()}
    return logs["wrench"].sample_times(), {name: log.data().T for name, log in logs.items()}


def test_it_grips_with_a_limited_force_after_its_reaction_delay():
    time, log = run(held=0.0, duration=0.4)
    assert (log["phase"] == MountingPhase.GRIP).all()
    assert (log["vacuum"] == 1.0).all()
    size = np.linalg.norm(log["wrench"][:, :3], axis=1)
    assert not size[time <= BEGIN].any()
    # of the 40 N that it wants; along the tool's axis
    np.testing.assert_allclose(log["wrench"][time > BEGIN + RAMP + 2e-3, 2], 30.0, rtol=1e-9)
    assert not log["wrench"][:, :2].any()


def test_it_leads_once_the_plate_hangs():
    time, log = run(held=1.0, duration=0.6)
    first = time[np.argmax(log["phase"][:, 0] == MountingPhase.LEAD)]
    assert first == pytest.approx(BEGIN, abs=2.0 * PERIOD)
    # until the delay is over it still delivers what it wanted while gripping
    after = (time > first + RAMP) & (time < first + DELAY - 2.0 * PERIOD)
    np.testing.assert_allclose(log["wrench"][after, 2], 30.0, rtol=1e-9)
    later = time > first + DELAY + 2.0 * PERIOD
    assert np.abs(log["wrench"][later, 2]).max() < 29.0
