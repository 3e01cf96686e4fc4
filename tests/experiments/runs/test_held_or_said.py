"""Random payloads, models, speeds and drives: the tool keeps to its path, or the run says so.

The truth is measured here: from the tool's way in the log to the path by brute force.
"""

import json

import h5py
import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.cli import main
from experiments.scenario_file import find_scenario
from pfsc_drake.yaml.typed import load_file

SCENARIO, BEARABLE = "pfc_elastic_3r", 1e-3  # m
DWELL = 0.1  # s, after which the tool should be there


def draw(seed):
    """Return random changes of the scenario, as arguments of the command line."""
    rng = np.random.default_rng(seed)
    way = rng.uniform(0.2, 0.5)
    changes = [
        f"model_error.mass={rng.uniform(0.7, 1.3):.3f}",
        f"model_error.stiffness={rng.uniform(0.85, 1.15):.3f}",
        f"model_error.tool_mass={rng.uniform(-0.9, 1.0):.3f}",
        f"controller.effort_scale={10.0 ** rng.uniform(-1.2, 0.0):.3f}",
        f"reference={{points: [0.96, {0.96 + way:.3f}], velocity: {rng.uniform(0.3, 3.0):.2f}, "
        f"acceleration: {rng.uniform(1.0, 20.0):.1f}, dwell: {DWELL}}}",
        "start.offset=[0, 0]",
        "targets={}",
    ]
    return [word for change in changes for word in ("--set", change)]


@pytest.fixture(scope="module")
def place_on_path():
    """Return points of the path, 0.1 mm from one to the next."""
    file = find_scenario(SCENARIO)
    curve = build_station(load_file(Scenario, file), file.parent).path.position
    return curve.derivatives(np.linspace(*curve.domain, 25_000), 0)[:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_held_or_said(tmp_path, capfd, place_on_path, seed):
    arguments = ["run", SCENARIO, "--out", str(tmp_path / "out"), "--no-figures", "--no-recording"]
    status = main([*arguments, *draw(seed)])
    told = capfd.readouterr()
    with h5py.File(tmp_path / "out" / "log.h5") as file:
        t, y_t, fault = file["t"][:], file["y_t"][:], file["fault"][:, 0]
    way = y_t[(t > DWELL) & (fault == 0)][::5]
    far = max(
        (float(np.sqrt(np.min(np.sum((place_on_path - y) ** 2, axis=1)))) for y in way),
        default=0.0,
    )
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert status == (3 if fault.any() else 0), told.err
    if status == 0:
        assert metrics["max_path_deviation"]["value"] == pytest.approx(far, abs=1e-4)
        assert ("the tool deviated by up to" in told.out) == (far > BEARABLE)
    else:
        assert told.err.startswith("fault: ")


@pytest.mark.parametrize(("judged_after", "status"), [("0.048", 3), ("0.049", 0)])
def test_a_run_is_judged_if_it_lasts(three_axes, judged_after, status):
    """However many of its samples are measured afterwards, each at a time of its own."""
    bound = "targets={elastic: {rms_path_deviation: {bound: '< 1e-12'}}}"
    run = three_axes(f"judged_after={judged_after}", bound, duration="0.047")
    assert run.status == status
