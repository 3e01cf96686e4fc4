"""What a run leaves: files, log, metrics, and for how long it runs."""

import math
import re

import numpy as np
import pytest
import yaml

from pfsc_drake.robot.models.files import models_directory

TICK = 1e-3  # s
PARAMETERS = yaml.safe_load(
    (models_directory() / "comau_racer_1_4" / "parameters.yaml").read_text(encoding="utf-8")
)
LIMITS = np.array(PARAMETERS["joint_limits"]["effort"])


def test_files(three_axes):
    bare = three_axes()
    assert bare.status == 0
    names = sorted(path.name for path in bare.folder.iterdir())
    assert names == ["log.h5", "manifest.json", "metrics.json", "report.html", "scenario.yaml"]
    assert f"Open the report: {bare.folder / 'report.html'}" in bare.stdout


def test_everything_that_a_run_can_write(six_axes):
    assert six_axes.status == 0
    names = {path.name for path in six_axes.folder.iterdir()}
    assert names == {
        "scenario.yaml",
        "log.h5",
        "metrics.json",
        "manifest.json",
        "figures",
        "recording.html",
        "report.html",
    }
    figures = list((six_axes.folder / "figures").iterdir())
    assert len(figures) >= 5
    for figure in figures:
        assert figure.read_bytes().startswith(b"\x89PNG")
    recording = (six_axes.folder / "recording.html").read_text(encoding="utf-8")
    assert len(recording) > 500_000
    report = (six_axes.folder / "report.html").read_text(encoding="utf-8")
    assert "recording.html" in report
    assert report.count("data:image/png;base64,") == len(figures)
    for text in ("pfc_elastic_6r", "max_orientation_error", "keyframes"):
        assert text in report
    unfolded = re.sub(r"<details.*?</details>", "", report, flags=re.DOTALL)
    for text in ("Duration", "Saturated drives", "trace of the tool point", "keyframes"):
        assert text in unfolded
    for text in ("peak_torque_1", "min_rcond"):
        assert text not in unfolded
    assert f"pfsc run {six_axes.folder / 'scenario.yaml'} --out OTHER" in unfolded
    assert f"pfsc compare {six_axes.folder} OTHER" in unfolded


SIGNALS = {
    # name: unit, labels
    "y_t": ("m", ["x", "y", "z"]),
    "R_e": ("1", [f"r{i}{j}" for i in "123" for j in "123"]),
    "theta": ("1", ["theta"]),
    "alpha": ("1", ["alpha"]),
    "eta": ("m", ["eta"]),
    "eta_dot": ("m/s", ["eta_dot"]),
    "eta_p": ("m", ["eta_p"]),
    "xi": ("m", ["xi_1", "xi_2"]),
    "xi_dot": ("m/s", ["xi_1_dot", "xi_2_dot"]),
    "xi_p": ("m", ["xi_1_p", "xi_2_p"]),
    "rcond": ("1", ["rcond"]),
    "saturated_drives": ("1", ["saturated_drives"]),
}
ORIENTATION = {
    "phi": ("rad", ["phi_z", "phi_y", "phi_x"]),
    "phi_dot": ("rad/s", ["phi_z_dot", "phi_y_dot", "phi_x_dot"]),
    "phi_p": ("rad", ["phi_z_p", "phi_y_p", "phi_x_p"]),
}
JOINTS = {
    "q_J": "rad",
    "q_M": "rad",
    "v_J": "rad/s",
    "v_M": "rad/s",
    "tau_d": "Nm",
    "tau_J": "Nm",
}


@pytest.mark.parametrize(("axes", "samples"), [(3, 1701), (6, 151)])
def test_log(three_axes, six_axes, axes, samples):
    result = three_axes() if axes == 3 else six_axes
    assert result.marks["t"]["unit"] == "s"
    np.testing.assert_allclose(result.t, TICK * np.arange(samples), atol=1e-9)
    signals = SIGNALS | (ORIENTATION if axes == 6 else {})
    signals |= {
        name: (unit, [f"{name}_{i + 1}" for i in range(axes)]) for name, unit in JOINTS.items()
    }
    for name, (unit, labels) in signals.items():
        assert result.marks[name]["unit"] == unit
        assert list(result.marks[name]["labels"]) == labels
        assert result[name].shape == (samples, len(labels))
        assert np.isfinite(result[name]).all()
    assert ("phi" in result.log) == (axes == 6)
    np.testing.assert_array_equal(result.marks["tau_d"]["limits"], LIMITS[:axes])
    assert result["fault"].dtype.kind == "i"
    assert result.marks["fault"]["labels"][0] == "none"


def test_attributes_of_the_log(three_axes):
    attributes = three_axes().attributes
    assert attributes["scenario"] == "pfc_elastic_3r"
    assert "fault" not in attributes
    q_J = np.rad2deg(three_axes()["q_J"][0])
    posture = ", ".join(f"q_{i} = {q:.1f} deg" for i, q in enumerate(q_J, start=1))
    assert attributes["start_posture"] == posture
    for name in ("git_revision", "drake_version", "casadi_version", "numpy_version"):
        assert attributes[name]
    assert attributes["numpy_version"] == np.__version__


def test_metrics(six_axes):
    for name, metric in six_axes.metrics.items():
        assert set(metric) <= {"value", "unit", "target", "source"}, name
        assert {"value", "unit"} <= set(metric), name
        assert metric["value"] is None or isinstance(metric["value"], float), name
    assert six_axes.metrics["controller_tick_us"]["unit"] == "us"
    median, p99 = (six_axes.metrics[f"controller_tick_us{x}"]["value"] for x in ("", "_p99"))
    assert 1.0 < median <= p99
    assert six_axes.metrics["real_time_factor"]["value"] > 0.0
    targets = {name for name, metric in six_axes.metrics.items() if "target" in metric}
    assert {"max_path_deviation", "max_orientation_error"} <= targets


def test_metrics_follow_from_the_log(three_axes):
    result = three_axes()
    distance = np.linalg.norm(result["xi"], axis=1)
    assert result.metrics["max_path_deviation"]["value"] == distance[result.after(0.3)].max()
    speed = np.abs(result["eta_dot"]).max()
    assert result.metrics["peak_speed"]["value"] == speed
    assert result.metrics["saturated_samples"]["value"] == 0.0
    torques = [result.metrics[f"peak_torque_{i}"]["value"] for i in (1, 2, 3)]
    np.testing.assert_array_equal(torques, np.abs(result["tau_d"]).max(axis=0))


@pytest.mark.slow
def test_the_resolved_scenario_gives_the_same_run(run_scenario, three_axes, tmp_path):
    first = three_axes("start.offset=[0.005, -0.002]", "reference.dwell=0.02", duration="0.1")
    again = run_scenario(tmp_path / "again", first.folder / "scenario.yaml")
    # while the tool comes to its path it is farther away than the target allows later
    assert again.status == first.status == 3
    assert set(again.log) == set(first.log)
    for name in first.log:
        np.testing.assert_array_equal(again[name], first[name], err_msg=name)
    resolved = [(r.folder / "scenario.yaml").read_text(encoding="utf-8") for r in (first, again)]
    assert resolved[0] == resolved[1]
    assert again.attributes["scenario"] == "pfc_elastic_3r"


@pytest.mark.slow
def test_files_of_an_earlier_run_are_replaced(run_scenario, tmp_path):
    out = tmp_path / "out"
    run_scenario(
        out, "pfc_elastic_3r", "--duration", "0.05", "--set", "controller.law=rigid", complete=True
    )
    assert (out / "recording.html").is_file()
    assert (out / "figures").is_dir()
    later = run_scenario(out, "pfc_elastic_3r", "--duration", "0.02")
    assert len(later.t) == 21
    names = sorted(path.name for path in out.iterdir())
    assert names == ["log.h5", "manifest.json", "metrics.json", "report.html", "scenario.yaml"]
    assert "recording.html" not in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow(but="0.001")
@pytest.mark.parametrize("duration", ["0.001", "0.0305", "0.35", "1.4"])
def test_duration_is_kept_to_the_sample(three_axes, duration):
    """Also where the sum of the steps between two looks at the run is not exact."""
    result = three_axes("controller.law=rigid", duration=duration)
    assert len(result.t) == math.floor(float(duration) / TICK + 1e-6) + 1


@pytest.mark.slow
def test_duration_of_the_scenario_and_of_its_reference(run_scenario, tmp_path):
    changes = ["controller.law=rigid", "reference.points=[0.96, 0.961]", "reference.dwell=0.01"]
    arguments = [x for change in changes for x in ("--set", change)]
    # two ramps of 35/16 v/a each, the way between them is half of their time times v
    ramp = math.sqrt(35.0 / 16.0 * 0.001 / 3.0)
    whole = run_scenario(tmp_path / "whole", "pfc_elastic_3r", *arguments)
    assert len(whole.t) == math.floor((2.0 * ramp + 0.02) / TICK) + 1
    short = run_scenario(tmp_path / "short", "pfc_elastic_3r", *arguments, "--set", "duration=0.03")
    assert len(short.t) == 31
