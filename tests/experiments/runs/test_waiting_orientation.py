"""Held back along the path: path following waits, trajectory tracking runs on (Sec. 3.8.4)."""

import numpy as np
import pytest

# s: converged, held back until, and still so
CONVERGED, END = 0.9, 1.9


@pytest.fixture(name="held_back", scope="module")
def fixture_held_back(tmp_path_factory, run_scenario):
    def run(scenario):
        out = tmp_path_factory.mktemp(scenario) / "out"
        result = run_scenario(out, scenario, "--duration", str(END))
        assert result.status == 0
        return result

    return {name: run(name) for name in ("pfc_comau_6r", "ttc_comau_6r")}


def deviation(run):
    return np.linalg.norm(run["xi"][run.t > CONVERGED], axis=1).max()


@pytest.mark.slow
def test_path_following_stays_on_the_path(held_back):
    assert deviation(held_back["ttc_comau_6r"]) > 5.0 * deviation(held_back["pfc_comau_6r"])


@pytest.mark.slow
def test_both_are_held_back(held_back):
    for run in held_back.values():
        late = run["eta_p"][-1, 0] - run["eta"][-1, 0]
        assert late > 0.01
        assert run.marks["orientation_lead"]["unit"] == "rad"


@pytest.mark.slow
def test_the_orientation_waits_or_runs_on(held_back):
    """By how much the path's orientation turns from where the tool is to where it should be."""
    assert held_back["pfc_comau_6r"]["orientation_lead"].max() < 1e-7
    lead = held_back["ttc_comau_6r"]["orientation_lead"][:, 0]
    run = held_back["ttc_comau_6r"]
    assert lead[(run.t > CONVERGED) & (run.t < 1.5)].max() < 1e-3
    # an independent measure: the reference's angles over the way that the tool is behind
    behind = np.interp(run["eta"][-1, 0], run["eta_p"][:, 0], np.arange(len(run.t)))
    turned = run["angles_d"][-1] - run["angles_d"][round(behind)]
    assert lead[-1] > np.deg2rad(0.5)
    assert np.linalg.norm(turned) == pytest.approx(lead[-1], rel=0.2)
