"""The search for the stiffest surface that a loop bears, on loops whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.studies.margins import walk
from experiments.studies.margins.loop import STIFFEST, LinearLoop
from experiments.studies.margins.walk import touched_surface

STIFFNESS, PERIOD, FREQUENCY = 3e4, 1e-3, 200.0


@pytest.mark.parametrize("limit", [0.5, 1.5, 11.3, 63.0, np.inf])
def test_the_stiffest_that_is_borne(limit, monkeypatch):
    def linear(loop, stiffness, chosen):
        radius = 0.9 if stiffness <= limit * STIFFNESS else 1.1
        turn = FREQUENCY * PERIOD
        rotation = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        return LinearLoop(radius * np.array(rotation), np.zeros(0))

    monkeypatch.setattr(walk, "linearize", linear)
    loop = SimpleNamespace(
        spring=SimpleNamespace(stiffness=STIFFNESS),
        map=SimpleNamespace(period=PERIOD),
        pressed_force=lambda section: 20.0,
        stiffened=lambda section, stiffness: stiffness,
    )
    found = touched_surface(loop, None, None, np.zeros(0), lambda phase: None)
    assert (found.stiffness, found.force) == (STIFFNESS, 20.0)
    if limit < 1.0:
        assert found.largest_factor == 0.0
    elif limit > STIFFEST:
        assert found.largest_factor == np.inf
        return
    else:
        assert limit / 1.1 < found.largest_factor <= limit
    assert found.frequency == pytest.approx(FREQUENCY)
