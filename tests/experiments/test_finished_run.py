"""From when on a run is judged."""

import pytest

from experiments.finished_run import converged_after
from tests.scenarios import shipped_scenario


@pytest.mark.parametrize(("transition", "begin"), [(0.0, 0.3), (0.2, 0.3), (0.5, 0.5)])
def test_a_tool_that_goes_over_to_the_path_is_not_beside_it_yet(transition, begin):
    """As one does that is driven, whose start is smooth by itself."""
    settings = shipped_scenario("pfc_turntable")
    assert settings.reference.dwell == 0.3
    settings.start.transition = transition
    assert converged_after(settings) == begin
