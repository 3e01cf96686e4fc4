"""Faults on the way, through the command line: status 3, everything logged so far is kept."""

import json
import math
from html import unescape

import h5py
import numpy as np
import pytest

from experiments.cli import main
from experiments.scenario_file import find_scenario

THREE, SIX = "pfc_elastic_3r", "pfc_elastic_6r"
BARE = ("--no-figures", "--no-recording")
TAUGHT = find_scenario("pfc_compliant_6r").parent / "paths" / "comau_teach_in.csv"


SERVOS = (
    "robot.model=comau_racer_1_4_3r",
    "controller.law=velocity_servo",
    "controller.gains.velocity_servo={eta: {poles: [-100]}, xi: {poles: [-100]}}",
    "targets.velocity_servo.joint_limit_margin={bound: '> 0'}",
)


@pytest.fixture
def fault(tmp_path, capfd, mine):
    """Run into a fault and return log, its attributes and metrics."""

    def check(explanation, *changes, name=THREE, duration="0.5"):
        out = tmp_path / "out"
        overrides = [argument for change in changes for argument in ("--set", change)]
        capfd.readouterr()
        arguments = ["run", mine(name), "--out", str(out), "--duration", duration, *BARE]
        status = main([*arguments, *overrides])
        stderr = capfd.readouterr().err
        assert status == 3, stderr
        assert stderr.startswith("fault: ")
        assert stderr.count("\n") == 1
        assert explanation in stderr
        assert "; still moving at t = " in stderr or "; stopped at t = " in stderr
        assert str(out) in stderr
        report = (out / "report.html").read_text(encoding="utf-8")
        assert explanation in report
        metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
        with h5py.File(out / "log.h5") as file:
            assert explanation in file.attrs["fault"]
            log = {key: dataset[:] for key, dataset in file.items()}
            log["limits"] = file["tau_d"].attrs["limits"]
            labels = list(file["fault"].attrs["labels"])
        log["fault"] = np.array([labels[code] for code in log["fault"][:, 0]])
        # the drives obey their limits, whatever happens, and the rest is on one time axis
        assert np.all(np.abs(log["tau_d"]) <= log["limits"])
        assert {len(x) for key, x in log.items() if key != "limits"} == {len(log["t"])}
        return log, metrics

    return check


@pytest.mark.slow(but="11")
@pytest.mark.parametrize("component", [0, 5, 6, 11])
def test_nan_on_the_way(fault, component):
    failure = f"simulation.sensor_failure={{time: 0.0305, component: {component}}}"
    name = f"{['q_J', 'v_J', 'q_M', 'v_M'][component // 3]}_{component % 3 + 1}"
    place = f"{name} at eta = 0.96 m, t = 0.031 s"
    log, metrics = fault(f"a measured value is not a finite number: {place}", failure)
    healthy = log["t"] < 0.0305
    assert set(log["fault"][healthy]) == {"none"}
    assert set(log["fault"][~healthy]) == {"input_not_finite"}
    states = ("q_J", "v_J", "q_M", "v_M")
    measured = np.hstack([log[f"{name}_measured"] for name in states])
    assert np.isfinite(measured[healthy]).all()
    assert np.isnan(measured[~healthy, component]).all()
    assert np.isfinite(np.hstack([log[name] for name in states])).all()
    # looked at every 50 ms; until then the drives hold the arm
    assert log["t"][-1] < 0.1
    assert np.isfinite(log["tau_d"]).all()
    assert np.abs(np.delete(measured[-1] - measured[30], component)).max() < 1.0
    assert metrics["saturated_samples"]["value"] == 0.0


@pytest.mark.slow
def test_going_on_after_a_fault(mine, tmp_path, capfd):
    """The status stays 3; the log tells of both, and the arm stands in the end."""
    out = tmp_path / "out"
    failure = ["--set", "simulation.sensor_failure={time: 0.35, component: 10}"]
    rest = ["--set", "reference.dwell=0.05", "--duration", "0.5", "--after-fault", "0.8"]
    assert main(["run", mine(), "--out", str(out), *BARE, *failure, *rest]) == 3
    assert "v_M_2" in capfd.readouterr().err
    with h5py.File(out / "log.h5") as file:
        assert float(file.attrs["fault_time"]) == pytest.approx(0.35)
        assert file["t"][-1] == pytest.approx(1.15, abs=0.06)
        assert np.abs(file["v_J"][-100:]).max() < 0.05
        assert np.abs(file["v_J"][340]).max() > 0.3


@pytest.mark.parametrize("seconds", ["-1", "nan", "soon", "1e9"])
def test_a_wrong_time_after_a_fault(mine, capfd, seconds):
    assert main(["run", mine(), "--after-fault", seconds]) == 2
    assert f"--after-fault {seconds}: allowed: 0 to 100" in capfd.readouterr().err


@pytest.mark.slow(but="pfc_elastic_3r")
@pytest.mark.parametrize("name", [THREE, SIX])
def test_nan_from_the_beginning(fault, name):
    place = "q_J_1 at t = 0.000 s"
    log, metrics = fault(place, "simulation.sensor_failure.time=0", name=name)
    assert set(log["fault"]) == {"input_not_finite"}
    assert np.isfinite(log["tau_d"]).all()
    assert metrics["max_path_deviation"]["value"] is None


@pytest.mark.slow
def test_singularity_on_the_way(fault, tmp_path):
    """A line leads to where the arm is stretched, and axis 3 beyond its limit of 80 deg."""
    log, metrics = fault(
        "elbow singular at eta = ",
        "path.shape=!Line {start: [1.1, 0, 1], end: [2, 0, 1]}",
        "reference={points: [0, 0.4975], velocity: 1, acceleration: 8, dwell: 0}",
        "controller.min_rcond=0.02",
        "start.offset=[0, 0]",
        "faults.joint_limits=false",
        "faults.overspeed=.inf",
        duration="1.5",
    )
    last_good = np.flatnonzero(log["fault"] == "none")[-1]
    assert set(log["fault"][last_good + 1 :]) == {"singular"}
    assert log["rcond"][:last_good, 0].min() >= 0.02
    # until the drives gave out the law was exact: first torques, then geometry
    exact = np.cumsum(log["saturated_drives"][:, 0]) == 0
    assert np.abs(log["xi"][exact]).max() < 1e-3
    assert 0.2 < log["eta"][last_good, 0] < 0.8
    beyond = log["q_J"][:, 2].max() - np.deg2rad(80.0)
    assert beyond > 0.05
    assert metrics["joint_limit_margin"]["value"] == pytest.approx(-beyond)
    assert metrics["joint_velocity_share"]["value"] > 1.0
    report = unescape((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert "joint 3 'motor_3' exceeds its limit of 80.0 deg at t = " in report


@pytest.mark.slow
def test_leaving_the_feasible_neighbourhood_on_the_way(fault):
    """Drives too weak for the arm's weight: it sinks from a circle's top through its centre."""
    radius = 0.05
    top = radius * math.pi / 2.0
    log, metrics = fault(
        "left the feasible neighbourhood",
        f"path.shape=!Circle {{radius: {radius}}}",
        f"reference.points=[{top}, 0.2]",
        "start.offset=[0, 0]",
        "controller.effort_scale=0.03",
        "faults.saturation_time=0",
    )
    np.testing.assert_allclose(log["limits"], [54.0, 54.0, 27.0])
    last_good = np.flatnonzero(log["fault"] == "none")[-1]
    assert set(log["fault"][last_good + 1 :]) == {"outside_feasible_neighbourhood"}
    assert log["alpha"][last_good, 0] < 0.95
    # alpha is the way from the circle to its axis, as a part of the radius
    depth = radius - np.linalg.norm((log["y_t"] - [0.8, 0.0, 1.0])[:, 1:], axis=1)
    assert 0.9 * radius < depth[last_good] < 0.96 * radius
    assert metrics["saturated_samples"]["value"] > 20


@pytest.mark.slow
def test_torque_saturation_is_counted_and_survived(mine, tmp_path, capfd):
    """The first torque wants 202 Nm of axis 1; a tenth of its limit is 180 Nm."""
    out = tmp_path / "out"
    arguments = ["--set", "controller.effort_scale=0.1", "--duration", "0.3", *BARE]
    assert main(["run", mine(), "--out", str(out), *arguments]) == 0
    assert capfd.readouterr().err == ""
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    with h5py.File(out / "log.h5") as file:
        tau_d, limits = file["tau_d"][:], file["tau_d"].attrs["limits"]
        saturated, xi = file["saturated_drives"][:, 0], file["xi"][:]
    np.testing.assert_allclose(limits, [180.0, 180.0, 90.0])
    at_limit = np.any(np.abs(tau_d) == limits, axis=1)
    assert np.all(np.abs(tau_d) <= limits)
    assert 0 < at_limit.sum() < 50
    np.testing.assert_array_equal(saturated > 0, at_limit)
    assert metrics["saturated_samples"]["value"] == at_limit.sum()
    assert np.linalg.norm(xi[-1]) < 1e-4  # nevertheless on the path in the end


@pytest.mark.slow
@pytest.mark.parametrize("limited", ["speed", "torque"])
def test_saturation_of_servos(run_scenario, tmp_path, limited):
    """Beside the path by 50 mm the law asks slow servos for 5 m/s; or weak ones do not obey."""
    too_much = {
        "speed": ("start.offset=[0.05, 0]", "servo.bandwidth=15"),
        "torque": ("start.offset=[0.005, 0]", "controller.effort_scale=0.1"),
    }
    changes = (*SERVOS, *too_much[limited])
    options = [argument for change in changes for argument in ("--set", change)]
    result = run_scenario(tmp_path / "out", "pfc_elastic_3r", "--duration", "0.2", *options)
    assert result.status == 0
    too_fast = result["saturated_drives"][:, 0] > 0
    too_strong = np.any(np.abs(result["tau_d"]) == result.marks["tau_d"]["limits"], axis=1)
    assert np.count_nonzero(too_fast & ~too_strong if limited == "speed" else too_strong) > 3
    assert too_fast.any() == (limited == "speed")
    saturated = np.count_nonzero(too_fast | too_strong)
    assert result.metrics["saturated_samples"]["value"] == saturated < 100
    margin = result.metrics["joint_limit_margin"]
    lower, upper = result.marks["q_J"]["limits"].T
    assert margin["value"] == np.minimum(result["q_J"] - lower, upper - result["q_J"]).min()
    assert margin["target"] == "> 0"
    share = np.abs(result["v_J"]) / result.marks["v_J"]["limits"]
    assert result.metrics["joint_velocity_share"]["value"] == share.max()


@pytest.mark.slow
def test_a_tool_that_is_turned_away(fault):
    """A torque beyond the drives turns the tool about x, until its angles say little."""
    log, _ = fault(
        "turned away from its reference by 90 deg or more",
        f"path.shape.file={TAUGHT}",
        "targets={}",
        "compliance={}",
        "controller.max_beyond_end=0.5",
        "encoders={}",
        "friction={}",
        "controller.friction={}",
        "faults.joint_limits=false",
        "faults.overspeed=.inf",
        "faults.saturation_time=0",
        "forces=[{begin: 0.1, end: 3.0, ramp: 0.05, torque: [400, 0, 0]}]",
        name="pfc_compliant_6r",
    )
    last_good = np.flatnonzero(log["fault"] == "none")[-1]
    assert set(log["fault"][last_good + 1 :]) == {"orientation_error"}
    angles = np.degrees(np.abs(log["phi"][: last_good + 1]))
    assert 75.0 < angles.max() < 90.0
