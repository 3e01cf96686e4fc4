"""Simulating a station: accuracy, progress, faults, and what is collected."""

import copy

import numpy as np
import pytest

from diagrams.builder import build_station
from experiments import simulation
from experiments.results.recorded_motion import collect_motion
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from tests.scenarios import shipped_scenario


class Listener:
    """Remembers what it is told."""

    def __init__(self) -> None:
        self.calls = []

    def expect(self, duration):
        self.calls.append((duration, "expected"))

    def __call__(self, simulated_time, phase):
        self.calls.append((simulated_time, phase))


@pytest.fixture
def settings():
    return shipped_scenario("pfc_elastic_3r")


@pytest.fixture
def run(settings):
    """Return station, result, log and what the listener heard."""

    def simulated(duration, **changes):
        for key, value in changes.items():
            setattr(settings.simulation, key, value)
        station = build_station(settings, None)
        listener = Listener()
        result = simulate(station, copy.deepcopy(settings.simulation), duration, listener)
        return station, result, collect_log(station, result.root), listener.calls

    return simulated


@pytest.mark.slow
def test_steps_are_fine_enough(settings, run):
    """Fixed steps as shipped against error control four orders tighter than what is asked."""
    assert settings.simulation.accuracy == 0.0
    _, _, shipped, _ = run(0.2)
    _, _, tight, _ = run(0.2, integrator="runge_kutta3", accuracy=1e-10)
    for signal, tolerance in (("q_J", 1e-6), ("y_t", 1e-6), ("xi", 1e-6)):
        np.testing.assert_allclose(
            shipped[signal].values, tight[signal].values, rtol=0.0, atol=tolerance
        )
    assert np.ptp(tight["q_J"].values, axis=0).max() > 5e-3  # it did move


def test_progress_is_told_on_the_way(settings, run):
    settings.controller.law = "rigid"
    _, result, _, calls = run(0.12)
    assert [phase for _, phase in calls] == ["simulating"] * 3
    np.testing.assert_allclose([time for time, _ in calls], [0.05, 0.1, 0.12], atol=1e-9)
    assert result.fault is None
    assert result.root.get_time() == pytest.approx(0.12, abs=1e-9)
    assert 0.1 < result.real_time_factor < 1e4


def test_a_fault_stops_the_run_soon(settings, run):
    settings.controller.law = "rigid"
    settings.simulation.sensor_failure.time = 0.06
    settings.simulation.sensor_failure.component = 6  # a motor, the law looks at no link
    _, result, log, calls = run(5.0)
    assert "not a finite number" in result.fault
    assert result.root.get_time() == pytest.approx(0.1, abs=1e-9)
    assert len(calls) == 2
    first = int(np.flatnonzero(log["fault"].values[:, 0])[0])
    assert log.time[first] == pytest.approx(0.06, abs=1e-9)


def test_an_integrator_that_gives_up_is_a_fault(settings, run, monkeypatch):
    """What was logged until then is kept."""
    settings.controller.law = "rigid"

    class Failing(simulation.Simulator):
        def AdvanceTo(self, boundary_time):
            super().AdvanceTo(min(boundary_time, 0.07))
            if boundary_time > 0.07:
                raise RuntimeError("the step is\n  too small")

    monkeypatch.setattr(simulation, "Simulator", Failing)
    _, result, log, _ = run(1.0)
    assert result.fault == "simulation failed: the step is too small"
    np.testing.assert_allclose(log.time, 1e-3 * np.arange(71), atol=1e-9)
    assert np.isfinite(log["q_J"].values).all()


def test_motion_at_the_frames(settings, run):
    settings.controller.law = "rigid"
    station, result, log, _ = run(0.1)
    motion = collect_motion(station, result.root, 0.032, log, 0.0)
    np.testing.assert_allclose(motion.times, [0.0, 0.032, 0.064, 0.096], atol=1e-9)
    context = station.part.plant.CreateDefaultContext()
    tool = station.part.plant.GetFrameByName("tool_point")
    for time, positions, pose in zip(motion.times, motion.positions, motion.tool_pose, strict=True):
        station.part.plant.SetPositions(context, positions)
        y_t = tool.CalcPoseInWorld(context).translation()
        np.testing.assert_allclose(pose[:3], y_t, atol=1e-12)
        np.testing.assert_array_equal(pose[:3], log["y_t"].values[round(time / 1e-3)])


@pytest.mark.parametrize(("time", "frames"), [(0.05, 2), (0.0, 0)])
def test_motion_ends_where_the_state_is_unknown(settings, run, time, frames):
    settings.controller.law = "rigid"
    settings.simulation.sensor_failure.time = time
    settings.simulation.sensor_failure.component = 6  # a motor, on which this law acts
    station, result, log, _ = run(0.1)
    motion = collect_motion(station, result.root, 0.032, log, 0.0)
    assert motion.times.shape == (frames,)
    assert motion.positions.shape == (frames, 6)
    assert motion.tool_pose.shape == (frames, 12)
    assert np.isfinite(motion.positions).all()


@pytest.mark.slow(but="0.4005")
@pytest.mark.parametrize("duration", [0.401, 0.4005])
def test_between_two_ticks_a_controller_finds_nothing_new(settings, run, duration):
    """There the last tick is less than a period ago: positions moved by less than they should."""
    settings.controller.sampling_time = 2e-3
    settings.reference.dwell, settings.start.offset = 0.05, [0.0, 0.0]
    settings.faults.plausibility = 5e-4
    station, result, log, _ = run(duration, integrator="runge_kutta3")
    assert np.abs(log["v_J"].values[-1]).max() > 0.5
    assert result.fault is None
    assert not log["fault"].values.any()
    assert not station.controller.suspects(station.blocks, result.root).any()
