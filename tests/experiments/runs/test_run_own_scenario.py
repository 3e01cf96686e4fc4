"""A scenario of a user's own, with waypoints beside it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

ARC = np.linspace(0.0, 1.2, 9)
ARC_POINTS = np.stack([0.9 - 0.1 * ARC, -0.2 + 0.3 * np.sin(ARC), 1.0 + 0.05 * ARC**2], axis=1)
ARC_ZYX = np.stack([np.pi + 0.1 * ARC, -0.3 + 0.2 * ARC, -0.1 * ARC], axis=1)
OWN_SCENARIO = """
description: A spline of my own.
robot: {model: comau_racer_1_4_elastic}
path:
  shape: !Waypoints {file: points/arc.csv}
controller:
  law: elastic
  gains:
    elastic:
      eta: {poles: [-50, -50, -50, -50]}
      xi: {poles: [-50, -50, -50, -50]}
      phi: {poles: [-50, -50, -50, -50]}
reference: {points: [0.05, 0.08], velocity: 0.5, acceleration: 2, dwell: 0.02}
start: {posture_deg: [0, 115, -40, 0, 95, 0]}
"""


@pytest.fixture
def own_scenario(tmp_path):
    """A scenario and its waypoints, in the folders of a user."""
    folder = tmp_path / "mine"
    (folder / "points").mkdir(parents=True)
    header = "x, y, z, zyx_1, zyx_2, zyx_3  # m, rad\n"
    rows = [", ".join(map(repr, row)) for row in np.hstack([ARC_POINTS, ARC_ZYX]).tolist()]
    (folder / "points" / "arc.csv").write_text(header + "\n".join(rows), encoding="utf-8")
    (folder / "own.yaml").write_text(OWN_SCENARIO, encoding="utf-8")
    return folder / "own.yaml"


@pytest.mark.slow
def test_own_scenario(run_scenario, own_scenario, tmp_path, monkeypatch):
    """The waypoints are found beside the scenario, wherever the command is given."""
    monkeypatch.chdir(tmp_path)
    result = run_scenario(tmp_path / "out", "mine/own.yaml")
    assert result.status == 0
    assert result.attributes["scenario"] == "own"
    assert result["eta"][0, 0] == pytest.approx(0.05, abs=1e-8)
    assert result["eta"][-1, 0] == pytest.approx(0.08, abs=1e-5)
    assert np.abs(result["xi"]).max() < 1e-5
    assert np.abs(result["phi"]).max() < 2e-5
    # the nearest place on the arc, in closed form on a fine grid
    fine = np.linspace(0.0, 1.2, 120_001)
    arc = np.stack([0.9 - 0.1 * fine, -0.2 + 0.3 * np.sin(fine), 1.0 + 0.05 * fine**2], axis=1)
    for k in (0, -1):
        distance = np.linalg.norm(arc - result["y_t"][k], axis=1)
        nearest = int(np.argmin(distance))
        assert distance[nearest] < 2e-5
        zyx = np.array([np.pi, -0.3, 0.0]) + np.array([0.1, 0.2, -0.1]) * fine[nearest]
        expected = Rotation.from_euler("ZYX", zyx).as_matrix()
        np.testing.assert_allclose(result["R_e"][k].reshape(3, 3), expected, atol=1e-4)


@pytest.mark.slow
def test_the_resolved_scenario_still_finds_its_waypoints(run_scenario, own_scenario, tmp_path):
    given = ("simulation.integrator=runge_kutta3", "simulation.max_step=1e-3")
    arguments = ["--duration", "0.02", *(part for key in given for part in ("--set", key))]
    first = run_scenario(tmp_path / "out", own_scenario, *arguments)
    again = run_scenario(tmp_path / "again", first.folder / "scenario.yaml", *arguments)
    assert again.status == 0
    assert again.attributes["scenario"] == "own"
    np.testing.assert_array_equal(again["q_J"], first["q_J"])
