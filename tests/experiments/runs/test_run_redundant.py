"""Runs of robots with more joints than outputs: what a user relies on, shortened."""

import numpy as np
import pytest

SHORT = {
    "pfc_panda_7r": (
        "1.4",
        "path.shape=!Circle {center: [0.48, 0, 0.42], radius: 0.05, axis_u: [0, 1, 0.2], "
        "axis_v: [-1, 0, 0.3]}",
        "reference={points: [0, 0.35], velocity: 0.5, acceleration: 4, dwell: 0.35}",
        "path.orientation.keyframes=[{theta: 0.0, angles_deg: [0, 0, 180]}]",
        # the posture still follows where the tool has come to rest just now
        "targets.rigid.posture_return={bound: '< 5e-3'}",
        "targets.rigid.final_joint_speed={bound: '< 5e-3'}",
    ),
    "pfc_elastic_7r": ("1.2",),
    "pfc_tool_axis_6r": ("1.0",),
    "pfc_wrist_singularity_6r": (
        "1.5",
        "reference={points: [0.18, 0.28, 0.18], velocity: 0.5, acceleration: 3, dwell: 0.3}",
    ),
    "pfc_elbow_7r": (
        "1.2",
        "pushes=[{link: link_3, way: [0.04, -0.08, -0.1], begin: 0.4, duration: 0.4, hold: 0.1}]",
        "targets.elastic.elbow_travel={bound: '> 0.05'}",
    ),
}
MET = {
    "pfc_panda_7r": {"posture_return", "final_joint_speed"},
    "pfc_elbow_7r": {"elbow_travel"},
}
WRIST = SHORT["pfc_wrist_singularity_6r"][1]


def run_short(tmp_path, run_scenario, name, *changes, duration=None):
    least, *own = SHORT[name]
    overrides = [x for change in (*own, *changes) for x in ("--set", change)]
    arguments = ["--duration", duration or least, *overrides]
    return run_scenario(tmp_path / "out", name, *arguments)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_targets_are_met(tmp_path, run_scenario, name):
    run = run_short(tmp_path, run_scenario, name)
    assert run.status == 0
    assert "missed" not in run.stdout
    told = {key for key, metric in run.metrics.items() if metric.get("target")}
    assert told >= {"max_path_deviation"} | MET.get(name, set())
    assert run.metrics["saturated_samples"]["value"] == 0
    n = run["q_J"].shape[1]
    assert run["q_posture"].shape == (len(run.t), n)
    assert run.marks["q_posture"]["unit"] == "rad"
    outputs = run["xi"].shape[1] + run["phi"].shape[1] + 1
    assert outputs == n - 1
    assert "decoupling_residual" not in run.log
    assert run["rcond"].min() > 0.02
    # the posture reference starts where the joints do
    np.testing.assert_allclose(run["q_posture"][0], run["q_J"][0], atol=1e-12)
    # what it moved, the hand of the elbow did
    moved = np.abs(run["q_posture"][-1] - run["q_posture"][0]).max()
    assert (moved > 0.05) == (name == "pfc_elbow_7r")


@pytest.mark.slow
def test_a_task_in_full_ends_at_the_wrist(tmp_path, run_scenario, capfd):
    run = run_short(
        tmp_path, run_scenario, "pfc_wrist_singularity_6r", "path.orientation.task=full"
    )
    assert run.status == 3
    assert "wrist singular at eta = 0.23" in capfd.readouterr().err
    assert run.attributes["fault"].startswith("wrist singular")
    # the line passes it half way, at 0.23 m
    assert 0.22 < run["eta"][-1, 0] < 0.26


@pytest.mark.slow
def test_damping_goes_through_the_wrist(tmp_path, run_scenario):
    """The tool turns round where damping is on; joints that it leaves free come to rest.

    They would go on, at 15 rad/s in the end, and take the tool off its path by 6 mm.
    """
    run = run_short(
        tmp_path,
        run_scenario,
        "pfc_wrist_singularity_6r",
        "path.orientation.task=full",
        "controller.damped_below=0.05",
        "targets={}",
    )
    assert run.status == 0
    # there and back
    assert run["eta"].max() > 0.27 and run["eta"][-1, 0] < 0.21
    assert run["rcond"].min() < 1e-3
    left = np.abs(run["decoupling_residual"]).max(axis=1)
    damped = run["rcond"][:, 0] < 0.05
    assert left[damped].max() > 0.0
    assert np.all(left[~damped] == 0.0)
    settled = run.after(0.32)
    assert np.linalg.norm(run["xi"], axis=1)[settled].max() < 5e-4
    assert np.abs(run["phi"][settled]).max() < 5e-4
    assert np.abs(run["v_J"]).max() < 1.0
    assert run.metrics["saturated_samples"]["value"] == 0


@pytest.mark.slow
def test_a_task_in_full_ends_at_the_limit_of_the_last_joint(tmp_path, run_scenario, capfd):
    run = run_short(tmp_path, run_scenario, "pfc_tool_axis_6r", "path.orientation.task=full")
    assert run.status == 3
    assert "joint 6 'motor_6' is at its limit of -180.0 deg" in capfd.readouterr().err
