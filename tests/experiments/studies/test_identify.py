"""The circle of an identification, shortened, on the robot with the fewest parameters."""

import json

import h5py
import pytest

from experiments.studies.identify import CircularRun, Drive, write_identification
from tests.one_process import short_experiments

pytestmark = pytest.mark.slow


@pytest.fixture(name="out", scope="module")
def fixture_out(tmp_path_factory):
    out = tmp_path_factory.mktemp("circle")
    drives = {"pfc_delta": Drive("pfc_delta", "parameters.yaml", friction=False)}
    circle = CircularRun("festo_expt_45", drives, starts=1, runs=2, limits={"acceleration": 30.0})
    told = []
    with short_experiments():
        report = write_identification(out / "found", told.append, [circle])
    assert report.problem is None
    assert any("model written" in line for line in told)
    assert sum(line.endswith(" mm") for line in told) == 3
    return out / "found"


def test_all_steps_leave_their_files(out):
    for name in (
        "excitation/excitation.csv",
        "runs/run_1.h5",
        "runs/run_2.h5",
        "validation/run_100.h5",
        "model/parameters.yaml",
        "excitation.html",
        "report.html",
    ):
        assert (out / name).is_file(), name
    with h5py.File(out / "identification.h5") as file:
        assert file["regressor"].shape[2] == file["base_parameters"].size
        assert len(file["repetitions/base_parameters"]) == 2


def test_the_identified_model_drives_as_well_as_the_true_one(out):
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["pfc_delta_ratio"]["value"] == pytest.approx(1.0, abs=0.1)
    assert metrics["pfc_delta_ratio"]["target"] == "<= 1.5"
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Control with the identified model" in page
