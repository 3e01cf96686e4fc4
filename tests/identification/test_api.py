"""The way from records to a model in Python, on the robot with the fewest parameters."""

import h5py
import numpy as np
import pytest

import identification
from identification import Identification, consistent_model, estimate, simulate
from pfsc_drake import InputError
from tests.one_process import short_experiments

ROBOT = "festo_expt_45"


@pytest.fixture(scope="module", name="found")
def fixture_found(tmp_path_factory):
    out = tmp_path_factory.mktemp("identification")
    with short_experiments():
        records = simulate(ROBOT, out=out / "runs", runs=1, quiet=True)
    assert [file.name for file in records] == ["run_1.h5"]
    return estimate(ROBOT, records[0], out=out / "found", simulated=True, quiet=True)


@pytest.mark.slow
def test_what_was_found(found):
    assert isinstance(found, Identification)
    assert found.estimate.base_parameters.shape == found.deviation.shape == (10,)
    with h5py.File(found.folder / "identification.h5") as file:
        np.testing.assert_array_equal(found.estimate.base_parameters, file["base_parameters"][:])
        np.testing.assert_allclose(found.deviation, file["standard_deviation"][:], rtol=1e-12)
    off = (found.estimate.base_parameters - found.findings.truth) / found.deviation
    assert abs(off).max() < 4.5
    assert found.report.is_file()
    assert found.figures["parameters"].read_bytes().startswith(b"\x89PNG")
    table = found._repr_html_()
    assert table.count("<tr>") == 1 + len(found.estimate.joint_names)
    assert "explained in %" in table


@pytest.mark.slow
def test_a_model_of_it(found, tmp_path):
    written = consistent_model(found, out=tmp_path / "model")
    assert all(file.is_file() for file in written.files)
    again = consistent_model(found.folder, ROBOT, out=tmp_path / "again")
    assert [file.read_bytes() for file in again.models] == [
        file.read_bytes() for file in written.models
    ]


def test_what_is_refused(tmp_path):
    with pytest.raises(InputError, match="no record; at least one is required"):
        estimate(ROBOT, [], out=tmp_path / "found", quiet=True)
    with pytest.raises(InputError, match=r"none\.yaml: cannot be read"):
        simulate(ROBOT, excitation=tmp_path / "none.yaml", out=tmp_path / "runs", quiet=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", identification.__all__)
def test_whatever_is_announced_is_there(name):
    assert getattr(identification, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'runs'"):
        identification.runs  # noqa: B018
