"""An arm of five joints follows the path and the direction of its tool's axis."""

import numpy as np
import pytest

from pfsc_drake.geometry import angle_between

FIVE = [
    "robot.model=comau_racer_1_4",
    "robot.fixed_joints={joint_6: 0.3}",
    "path.orientation.task=tool_axis",
    "controller.law=rigid",
    "controller.gains.rigid={eta: {poles: [-50, -50]}, xi: {poles: [-50, -50]}, "
    "phi: {poles: [-50, -50]}}",
    "start.posture_deg=[-25, 115, -40, -5, 95]",
    "reference.dwell=0.1",
    "hold_back.force=0",
]
CONVERGED, END = 0.45, 0.7


@pytest.fixture(name="five_axes", scope="module")
def fixture_five_axes(tmp_path_factory, run_scenario):
    """Return a function that runs five axes."""

    def run(name, *changes, complete=False):
        out = tmp_path_factory.mktemp("five") / "out"
        arguments = [x for change in (*FIVE, *changes) for x in ("--set", change)]
        arguments += ["--duration", str(END), "--no-recording"]
        result = run_scenario(out, name, *arguments, complete=complete)
        assert result.status == 0
        return result

    return run


@pytest.mark.slow
def test_five_axes_follow_a_path_with_an_axis(five_axes):
    run = five_axes("pfc_comau_6r", complete=True)
    late = run.after(CONVERGED)
    assert np.linalg.norm(run["xi"], axis=1)[late].max() < 2e-6
    between = angle_between(run["axis_e"], run["axis_d"])
    assert np.rad2deg(between[0]) > 2.0
    assert between[late].max() < 2e-6
    # the third column of the tool's orientation, and how far it is turned away
    np.testing.assert_array_equal(run["axis_e"], run["R_e"].reshape(-1, 3, 3)[:, :, 2])
    assert run["phi"].shape == (len(run.t), 2)
    cosines = np.cos(run["phi"]).prod(axis=1)
    np.testing.assert_allclose(cosines, np.cos(between), rtol=0, atol=1e-12)
    assert list(run.marks["phi"]["labels"]) == ["phi_z", "phi_y"]
    assert "angles_e" not in run.log
    assert run["orientation_lead"].max() < 1e-7
    assert run.metrics["max_orientation_error"]["unit"] == "rad"
    assert {"axis.png", "orientation.png"} <= {p.name for p in (run.folder / "figures").iterdir()}
    page = (run.folder / "report.html").read_text(encoding="utf-8")
    assert "about which its rotation is free" in page


@pytest.mark.slow
def test_a_point_that_moves_with_time(five_axes):
    run = five_axes("pfc_comau_6r", "controller.manifold=trajectory")
    late = run.after(CONVERGED)
    assert np.linalg.norm(run["tracking_error"], axis=1)[late].max() < 5e-6
    assert angle_between(run["axis_e"], run["axis_d"])[late].max() < 5e-6


@pytest.mark.slow
def test_six_axes_turn_the_tool_about_its_axis_meanwhile(five_axes):
    """Where it turns to is the posture's; the axis does not notice."""
    run = five_axes(
        "pfc_comau_6r",
        "robot.fixed_joints={}",
        "start={posture_deg: [-25, 115, -40, -5, 95, -170]}",
        "controller.posture={reference_deg: [-25, 115, -40, -5, 95, 170], stiffness: 64, "
        "damping: 16, inertia: 1}",
    )
    turned = np.rad2deg(run["q_J"][-1, 5] - run["q_J"][0, 5])
    assert turned > 150.0
    # as fast as its posture may be pulled: half of 600 deg/s
    assert np.rad2deg(np.abs(run["v_J"][:, 5]).max()) < 320.0
    assert angle_between(run["axis_e"], run["axis_d"]).max() < 2e-6
    assert np.linalg.norm(run["xi"], axis=1).max() < 2e-6


@pytest.mark.slow
def test_a_target_of_the_orientation_where_it_is_no_task(tmp_path, run_scenario):
    changes = ("--set", "path.orientation.task=none", "--duration", "0.02")
    run = run_scenario(tmp_path / "out", "pfc_elastic_6r", *changes)
    assert run.status == 0
    assert "phi" not in run.log and "axis_e" not in run.log
    assert run["q_J"].shape[1] == 6
    assert "max_orientation_error" not in run.metrics
