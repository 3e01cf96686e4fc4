"""Guidance by a hand (Sec. 5.2), through the command line, shortened."""

import h5py
import numpy as np
import pytest

from experiments.cli import main

CENTER, RADIUS = np.array([0.83, 0.0, 0.9]), 0.15  # (5.3)


def run(folder, scenario, duration, *changes):
    arguments = ["run", scenario, "--out", str(folder), "--duration", str(duration)]
    changes = [text for change in changes for text in ("--set", change)]
    assert main([*arguments, "--no-figures", "--no-recording", *changes]) == 0
    with h5py.File(folder / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}


@pytest.mark.slow
def test_the_tool_is_held_on_a_circle_whose_radius_swings(tmp_path):
    """Place of the tool in the world against the radius over time, not the law's coordinates."""
    log = run(tmp_path, "vf_dynamic_circle", 4.0)
    t, from_center = log["t"], log["y_t"] - CENTER
    late = t > 1.5
    wanted = RADIUS + 0.02 * np.sin(2.0 * np.pi * 0.5 * (t - 0.5))
    error = np.linalg.norm(from_center[:, :2], axis=1) - wanted
    assert np.abs(error[late]).max() < 1e-3
    assert np.abs(from_center[:, 2]).max() < 1e-3
    assert log["eta"][-1] > 0.1  # led by the hand


@pytest.mark.slow
def test_the_hand_cannot_push_the_tool_off_a_hard_path(tmp_path):
    places = "{time: 0.8, position: [0.05, 0, 0]}, {time: 2.5, position: [0.3, 0.05, 0]}"
    leaning = f"hand.waypoints=[{places}]"
    log = run(tmp_path, "vf_hard_spline", 3.0, leaning)
    assert np.linalg.norm(log["xi"], axis=1).max() < 0.4e-3
    assert log["eta"][-1] > 0.2
    assert np.abs(log["manifold_force"][:, 1:3]).max() > 10.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "place", "push"), [("vf_hard_spline", 0.01, -45), ("operator_hand_6r", 1.01, 45)]
)
def test_the_hand_cannot_push_the_tool_past_an_end(tmp_path, scenario, place, push):
    """Behind servos and with torques that give way, at the start and at the end."""
    force = f"forces=[{{begin: 0.32, end: 9, ramp: 0.02, frame: manifold, force: [{push}, 0, 0]}}]"
    given = [f"reference.points=[{place}, {place}]", "hand=null", force]
    log = run(tmp_path, scenario, 0.8, *given)
    first, last = (0.0, 1.02001)
    end = first if push < 0 else last
    assert np.abs(log["manifold_force"][:, 0]).max() > 40.0
    assert abs(log["eta"][-1, 0] - end) < 1e-3
    assert first - 5e-4 < log["eta"].min()
    assert log["eta"].max() < last + 5e-4


@pytest.mark.slow
def test_the_hand_pulls_the_tool_off_a_soft_path_and_turns_it(tmp_path):
    """At rest the stiffnesses of Tab. 4.3 bear the hand."""
    still = (
        "hand.waypoints=[{time: 0.8, position: [0, 0, 0], zyx_deg: [171.92, -44.71, 5.70]}, "
        "{time: 1.5, position: [0, -0.06, 0], zyx_deg: [211.92, -44.71, 5.70]}]"
    )
    log = run(tmp_path, "vf_soft_circle", 3.5, still, "hand.tremor=0")
    late = log["t"] > 3.0
    force = log["manifold_force"][late, 1].mean()
    assert abs(force) > 20.0
    assert log["xi"][late, 0].mean() == pytest.approx(force / 5000.0, rel=0.05)
    sunk = (log["y_t"][late] - CENTER)[:, 2].mean()
    assert sunk == pytest.approx(-abs(force) / 5000.0, rel=0.1)
    torque, phi = (log[name][late].mean(axis=0) for name in ("manifold_force", "phi"))
    assert np.linalg.norm(torque[3:]) > 2.0
    # of which the damping, 24.6 Nm s/rad, leaves 6 % to come
    np.testing.assert_allclose(phi, torque[3:] / 34.4, rtol=0, atol=0.01)
    assert np.rad2deg(np.linalg.norm(phi)) > 3.0


def test_a_surface_has_no_second_coordinate_to_swing(tmp_path, capsys):
    change = "reference.swings=[{coordinate: 2}]"
    arguments = ["run", "sfc_comau_paraboloid", "--out", str(tmp_path), "--set", change]
    assert main(arguments) == 2
    assert "reference.swings[0]: coordinate = 2; there is 1" in capsys.readouterr().err


@pytest.mark.slow
def test_the_hand_leads_the_tool_along_an_edge(tmp_path):
    """True place of the tool against the equations of paraboloid and cylinder."""
    places = "{time: 0.3, position: [0, 0, 0]}, {time: 1.2, position: [0.15, 0.05, 0]}"
    log = run(tmp_path, "vf_edge", 1.4, f"hand.waypoints=[{places}]", "targets={}")
    y_t = log["y_t"][300:]
    x, axis = y_t - [0.85, 0.0, 0.75], np.array([0.3, 0.1, 1.0]) / np.sqrt(1.1)
    slope = 8.0 * np.linalg.norm(x[:, :2], axis=1)
    from_paraboloid = (x[:, 2] - 4.0 * (x[:, :2] ** 2).sum(axis=1)) / np.hypot(1.0, slope)
    x = y_t - [0.87, 0.02, 0.85]
    from_cylinder = np.linalg.norm(x - np.outer(x @ axis, axis), axis=1) - 0.15
    assert np.abs(from_paraboloid).max() < 0.4e-3
    assert np.abs(from_cylinder).max() < 0.4e-3
    assert log["eta"][-1] > 0.08
    assert np.abs(log["manifold_force"][:, 1:3]).max() > 10.0
