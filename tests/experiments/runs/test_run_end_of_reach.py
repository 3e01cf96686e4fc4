"""A hand that pulls a tool to where the arm ends, through the command line."""

import json

import h5py
import pytest

from experiments.cli import main
from tests.experiments.runs.test_run_fixtures import run, way

pytestmark = pytest.mark.slow

ABOVE = [1.45, 0.02, 0.92]
# a plane below the tool, near a stretched elbow, and a hand that pulls outwards and into it
CHANGES = (
    "fixtures.regions=[{shape: !Plane {origin: [1.4, 0, 0.9], first: [-1, 1], second: [-1, 1]}}]",
    way([(0.5, ABOVE), (0.7, [2.5, 0.1, 0.8])]),
    f"start.position={ABOVE}",
    "start.posture_deg=[0, 60, 0, 0, 70, -6]",
    "friction={}",
    "encoders={}",
    "model_error={}",
)


def told(law, *others):
    """Return the changes for a law that is told what the hand does."""
    return f"controller.law={law}", "controller.external_torque.source=known", *others


GAINS = "{elastic: {eta: {poles: [-60, -60, -220, -300]}, phi: {poles: [-60, -60, -220, -300]}}}"
LAWS = {
    "velocity_servo": (),
    "rigid": told("rigid"),
    "elastic": told("elastic", "robot.model=comau_racer_1_4_elastic", f"controller.gains={GAINS}"),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_it_feels_a_wall(tmp_path, law):
    log, metrics = run(tmp_path, "vf_forbidden_region", 1.3, *CHANGES, *law)
    assert metrics["deepest_violation"] < 0.2e-3
    assert metrics["time_at_limits"] > 0.3
    assert metrics["joint_velocity_share"] < 0.75
    assert metrics["audit_stationarity"] < 1e-12
    # the arm has come to rest at its end
    assert abs(log["v_J"][-1]).max() < 0.15
    held = log["limit_force"][-1]
    assert held.max() > 10.0


ALONG = """
name: led
robot: {{model: comau_racer_1_4, tool_frame: tool_point}}
{task}
compliance:
  tangential: {{mass: {{value: 5}}, damping: {{value: 60}}, stiffness: {{value: 0}}}}
hand:
  frame: manifold
  waypoints: [{{time: 0.2, position: [0.05, 0, 0]}}, {{time: 0.8, position: [0.6, {aslant}, 0]}}]
  stiffness: 400
  force_limit: 30
sensor: {{bandwidth: 200, inertia: none}}
duration: 1.3
controller:
  manifold: {kind}
  law: velocity_servo
  gains:
    velocity_servo:
      eta: {{coefficients: [10]}}
      xi: {{coefficients: [15]}}
      phi: {{coefficients: [12]}}
"""
PATH = """
path:
  shape: !Line {start: [1.35, 0.02, 0.92], end: [2.0, 0.02, 0.92]}
  orientation: {convention: zyz, keyframes: [{theta: 0.0, angles_deg: [0.0, 45.0, 174.2704]}]}
reference: {points: [0.05, 0.05], dwell: 0.3}
start: {posture_deg: [0, 70, -10, 0, 70, -6]}
"""
SURFACE = """
surface:
  shape: !Plane {origin: [1.35, 0.02, 0.92], first: [-0.3, 0.8], second: [-0.6, 0.6]}
  orientation: {kind: given, convention: zyz, angles_deg: [0.0, 45.0, 174.2704]}
reference: {places: [[0.05, 0.0], [0.05, 0.0]], dwell: 0.3}
start: {theta: [0.05, 0.0], posture_deg: [0, 70, -10, 0, 70, -6]}
"""
MANIFOLDS = {
    "path": ALONG.format(kind="path", task=PATH, aslant=0.0),
    "surface": ALONG.format(kind="surface", task=SURFACE, aslant=0.2),
}


@pytest.mark.parametrize("manifold", MANIFOLDS.values(), ids=MANIFOLDS)
def test_a_hand_that_leads_along_a_manifold_feels_a_wall_too(tmp_path, manifold):
    """It goes on where the arm ends; without limits it is left by 160, 230 mm, and a fault."""
    (tmp_path / "led.yaml").write_text(manifold)
    arguments = ["run", str(tmp_path / "led.yaml"), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--no-figures", "--no-recording"]) == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["max_path_deviation"]["value"] < 1e-3
    assert metrics["time_at_limits"]["value"] > 0.2
    assert metrics["largest_limit_force"]["value"] > 10.0
    with h5py.File(tmp_path / "out" / "log.h5") as file:
        eta = file["eta"][:, 0]
    assert abs(eta[-1] - eta[-101]) < 0.01  # in 0.1 s
    assert 0.1 < eta[-1] < 0.3
