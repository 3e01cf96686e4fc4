"""A force sensor in front of a tool without mass reads the force on the tool, and nothing else."""

import numpy as np
import pytest

from tests.diagrams.robots.test_massless_tool import fixture_massless  # noqa: F401


@pytest.mark.slow
def test_the_sensor_reads_the_force_on_the_tool(massless, tmp_path, run_scenario):
    changes = [
        f"robot.model={massless}",
        "model_error={}",
        "encoders={}",
        "friction={}",
        "sensor={noise: [0, 0, 0, 0, 0, 0], bias: [8, -5, 12, 0.3, -0.2, 0.1], bandwidth: 200}",
        "forces=[{begin: 0.25, end: 0.5, ramp: 0.02, force: [10, 20, -15]}]",
        "start.transition=0",
        "start.posture_deg=[-25, 115, -40, -5, 95, -17]",
    ]
    arguments = [x for change in changes for x in ("--set", change)]
    run = run_scenario(tmp_path / "out", "pfc_compliant_6r", *arguments, "--duration", "0.45")
    assert run.status == 0
    late = run.after(0.35)
    np.testing.assert_allclose(run["wrench_ext"][late][:, :3], [[10.0, 20.0, -15.0]] * late.sum())
    np.testing.assert_allclose(
        run["wrench_measured"][late], run["wrench_ext"][late], rtol=0, atol=0.05
    )
