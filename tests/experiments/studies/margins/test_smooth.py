"""What is taken off a scenario before its loop is linearized."""

import pytest

from diagrams.scenario import Scenario
from diagrams.scenario.workpiece import WorkpieceParameters
from experiments.studies.margins.box import smooth


@pytest.mark.parametrize("workpiece", [None, WorkpieceParameters()])
def test_what_presses_keeps_off_its_workpiece_at_the_start(workpiece):
    """It may stand where the surface was taught: on that, the tool would be inside of it."""
    settings = Scenario(workpiece=workpiece)
    settings.start.offset = [0.01, 0.0]
    found, removed = smooth(settings)
    assert found.start.offset == ([0.0, 0.0] if workpiece is None else [0.01, 0.0])
    assert ("start beside the path" in removed) == (workpiece is None)
    settings.start.rotation_deg = [1.0, 0.0, 0.0]
    assert smooth(settings)[0].start.rotation_deg == [0.0, 0.0, 0.0]
    assert settings.start.offset == [0.01, 0.0]
