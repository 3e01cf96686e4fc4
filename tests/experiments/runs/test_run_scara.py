"""A four-axis arm follows a path with position and one turn, which goes on and on."""

import numpy as np
import pytest

from experiments.cli import main

SCARA = "pfc_scara_4r"
FAST = "gains.{}={{eta: {{poles: auto, bandwidth: 60}}, xi: {{poles: auto, bandwidth: 60}}, "
FAST += "phi: {{poles: auto, bandwidth: 60}}}}"


@pytest.fixture(name="scara", scope="module")
def fixture_scara(tmp_path_factory, run_scenario):
    """Return a function that runs the four-axis arm."""

    def run(*changes, duration="0.8", complete=False):
        out = tmp_path_factory.mktemp("scara") / "out"
        arguments = [x for change in changes for x in ("--set", change)]
        arguments += ["--duration", duration, "--no-recording"]
        result = run_scenario(out, SCARA, *arguments, complete=complete)
        assert result.status == 0
        return result

    return run


def turned_about_the_vertical(run):
    """Return the turn of the tool from the log's rotation matrices alone, without jumps [rad]."""
    R_e = run["R_e"].reshape(-1, 3, 3)
    return np.unwrap(np.arctan2(R_e[:, 1, 0], R_e[:, 0, 0]))


@pytest.mark.slow
def test_two_turns_and_one_angle_everywhere(scara):
    """It starts 5 deg beside; each lap turns the tool by 360 deg, and the angle does not jump."""
    run = scara(duration="2.65", complete=True)
    late = run.after(0.4)
    assert run["phi"].shape == (len(run.t), 1)
    assert np.rad2deg(run["phi"][0]) == pytest.approx(5.0, abs=1e-6)
    assert np.abs(run["phi"][late]).max() < 0.3e-3
    assert np.linalg.norm(run["xi"], axis=1)[late].max() < 0.05e-3
    turn = turned_about_the_vertical(run)
    assert np.rad2deg(turn[-1] - turn[0]) == pytest.approx(715.0, abs=1e-2)
    assert run["angles_e"].shape == run["angles_d"].shape == (len(run.t), 1)
    np.testing.assert_allclose(run["angles_e"][:, 0], turn, rtol=0, atol=1e-9)
    assert np.abs(np.diff(run["angles_d"][:, 0])).max() < 0.01
    np.testing.assert_allclose(run["angles_e"] - run["angles_d"], run["phi"], rtol=0, atol=1e-9)
    assert run["orientation_lead"].max() < 1e-9
    assert run.metrics["max_orientation_error"]["value"] == np.abs(run["phi"][late]).max()
    assert {"angles.png", "orientation.png"} <= {p.name for p in (run.folder / "figures").iterdir()}
    page = (run.folder / "report.html").read_text(encoding="utf-8")
    assert "its tilt is not controlled" in page
    # the arm cannot tilt its tool
    np.testing.assert_allclose(run["R_e"][:, 8], -1.0, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_the_virtual_input_is_what_the_rates_change_by(scara):
    """While the tool comes to the path, before speed along it bends what a sample holds."""
    run = scara(duration="0.4")
    kinds = ("eta", "xi", "phi")
    names = [f"v_{label}" for kind in kinds for label in run.marks[kind]["labels"]]
    assert list(run.marks["virtual_input"]["labels"]) == names
    assert run.marks["virtual_input"]["unit"] == "SI/s^2"
    rates = np.column_stack([run[f"{kind}_dot"] for kind in kinds])
    found = np.diff(rates, axis=0) / np.diff(run.t)[:, None]
    span = np.abs(run["virtual_input"]).max(axis=0)
    assert np.all(span > [0.5, 1.0, 1.0, 1.0])
    assert np.all(np.abs(found - run["virtual_input"][:-1]) < 1e-3 * span)


@pytest.mark.slow
def test_elastic_joints_and_time(scara):
    """The law of order four, and a point that moves with time."""
    elastic = "robot.elastic={stiffness: [20000, 10000, 2000000, 400]}"
    gains = "controller." + FAST.format("elastic")
    run = scara(elastic, gains, "controller.law=elastic")
    late = run.after(0.35)
    assert np.linalg.norm(run["xi"], axis=1)[late].max() < 0.03e-3
    assert np.abs(run["phi"][late]).max() < 0.5e-3
    run = scara("controller.manifold=trajectory")
    assert np.linalg.norm(run["tracking_error"], axis=1)[run.after(0.4)].max() < 0.1e-3


def test_a_torque_about_the_vertical_turns_the_tool_past_half_a_turn(scara):
    """A tool that turns freely is turned by 200 deg and more; nothing jumps on the way."""
    compliance = (
        "compliance={source: sensor, tangential: {mass: {value: 10}, damping: {value: 100}, "
        "stiffness: {value: 1000}}, transversal: {mass: {value: 10}, damping: {value: 100}, "
        "stiffness: {value: 1000}}, rotational: {mass: {value: 0.02}, damping: {value: 0.2}, "
        "stiffness: {value: 0}}}"
    )
    torque = "forces=[{begin: 0.1, end: 0.6, ramp: 0.02, force: [0, 0, 0], torque: [3.0, 0, 2.0]}]"
    run = scara(
        compliance,
        torque,
        "targets={}",
        "controller.external_torque.source=measured",
        "reference={points: [0.0, 0.01], velocity: 0.01, acceleration: 1.0}",
        "start={posture_deg: [-20, 60, 0, -40]}",
        duration="0.65",
    )
    assert np.rad2deg(run["phi"][-1, 0]) > 200.0
    assert np.abs(run["phi"] - run["phi_p"]).max() < 5e-3
    # torque about x does nothing; 2 Nm over 0.2 Nm s/rad is the speed in the end
    rate = np.gradient(run["phi"][:, 0], run.t)[np.searchsorted(run.t, 0.57)]
    assert rate == pytest.approx(10.0, rel=0.02)
    steps = np.diff(turned_about_the_vertical(run)) - np.diff(run["phi"][:, 0])
    assert np.abs(steps).max() < 1e-4


@pytest.mark.slow
def test_a_tilt_that_the_arm_cannot_have(tmp_path, run_scenario, capfd):
    def refused(*changes):
        arguments = [x for change in changes for x in ("--set", change)]
        assert main(["run", SCARA, "--out", str(tmp_path / "out"), *arguments]) == 2
        return capfd.readouterr().err

    upward = "path.orientation.keyframes=[{angles_deg: [30, 0, 0]}]"
    line = refused(upward)
    assert "tilted by 180 deg" in line and "at most 90 deg" in line and "[yaw, 0, 180]" in line
    line = refused("path.orientation.task=full")
    assert "4 joints for 6 outputs" in line and "path.orientation.task: yaw" in line
    line = refused("path.orientation.keyframes=[]")
    assert "path.orientation.task = yaw: the path has no orientation" in line
    line = refused("path.orientation.yaw_axis=[0, 0, 0]")
    assert "yaw_axis = [0.0, 0.0, 0.0]" in line
    tilted = "path.orientation.keyframes=[{angles_deg: [30, 10, 180]}]"
    run = run_scenario(tmp_path / "run", SCARA, "--set", tilted, "--duration", "0.02")
    assert run.status == 0
    assert "tilted by 10 deg" in run.stdout
    assert run["R_e"][0, 8] == pytest.approx(-1.0)
