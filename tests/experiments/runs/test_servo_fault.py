"""A run with velocity servos whose sensor fails: it ends, is at rest, and its log is kept."""

import h5py
import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.cli import main
from experiments.scenario_file import find_scenario
from experiments.simulation import simulate
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.yaml.typed import load_file

SCENARIO = find_scenario("pfc_compliant_6r")
FAILS_AT = 0.7
V_M_2 = 3 * 6 + 1


@pytest.fixture
def settings():
    settings = load_file(Scenario, SCENARIO)
    settings.controller.law = "velocity_servo"
    settings.reference.dwell = 0.05
    settings.simulation.sensor_failure.time = FAILS_AT
    settings.simulation.sensor_failure.component = V_M_2
    return settings


@pytest.mark.slow
@pytest.mark.parametrize("component", [0, V_M_2])
def test_the_arm_comes_to_rest(settings, component):
    """Nobody stops the simulation; the arm was moving with up to 0.2 rad/s."""
    settings.simulation.sensor_failure.component = component
    station = build_station(settings, SCENARIO.parent)
    simulator = Simulator(station.diagram)
    fixed = SimulatorConfig(
        integration_scheme="runge_kutta2", max_step_size=1e-3, use_error_control=False
    )
    ApplySimulatorConfig(fixed, simulator)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    plant = station.part.model
    speeds = []
    for end in (FAILS_AT, FAILS_AT + 0.5):
        simulator.AdvanceTo(end)
        speeds.append(np.abs(plant.GetVelocities(plant.GetMyContextFromRoot(root))).max())
    assert speeds[0] > 0.05
    # all axes stop, that whose velocity is not known as well
    v = np.abs(plant.GetVelocities(plant.GetMyContextFromRoot(root)))
    assert v.max() < 0.05 * speeds[0]
    _, raw = station.log.read(root)
    assert np.isfinite(raw["drive_torque"]).all()
    assert np.all(np.abs(raw["drive_torque"]) <= station.robot.gather("effort_limit") + 1e-9)
    assert raw["servo_fault"][-1, 0] == Fault.INPUT_NOT_FINITE


@pytest.mark.slow
def test_the_run_ends_and_keeps_its_log(tmp_path, capsys):
    changes = {
        "controller.law": "velocity_servo",
        "simulation.sensor_failure.time": 0.2,
        "simulation.sensor_failure.component": V_M_2,
    }
    options = [part for key, value in changes.items() for part in ("--set", f"{key}={value}")]
    bare = ["--no-figures", "--no-recording", "--duration", "2"]
    assert main(["run", "pfc_compliant_6r", "--out", str(tmp_path), *bare, *options]) == 3
    assert "not a finite number" in capsys.readouterr().err
    with h5py.File(tmp_path / "log.h5") as file:
        t, fault = file["t"][:], file["servo_fault"]
        assert fault.attrs["labels"][1] == "input_not_finite"
        assert t[np.argmax(fault[:, 0] > 0)] == pytest.approx(0.2, abs=1e-9)
        assert t[-1] < 0.3
        assert np.isfinite(file["tau_d"][:]).all()


def test_a_servo_alone_stops_the_run(settings, monkeypatch):
    settings.simulation.sensor_failure.time = 0.06
    station = build_station(settings, SCENARIO.parent)
    monkeypatch.setattr(station.controller, "fault", lambda *_: Fault.NONE)
    result = simulate(station, settings.simulation, 2.0, lambda *_: None)
    assert result.fault.startswith("velocity_servo: a measured value is not a finite number: v_M_2")
    assert result.root.get_time() == pytest.approx(0.1, abs=1e-9)
