"""A hand that pulls a tool along a plane to where the arm ends, through the command line."""

import pytest

from tests.experiments.runs.test_run_fixtures import run, way

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


# told what the hand does
RIGID = ("controller.law=rigid", "controller.external_torque.source=known")


@pytest.mark.parametrize("law", [(), RIGID], ids=["velocity_servo", "rigid"])
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
