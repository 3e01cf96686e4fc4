"""Run log: HDF5 file as other tools read it, round trip, attributes."""

import re
import subprocess

import h5py
import numpy as np
import pytest

from experiments.results.run_log import RunLog, Signal
from pfsc_drake import InputError
from reporting.provenance import PROJECT_ROOT, git_revision, standard_attributes


def make_log() -> RunLog:
    time = np.linspace(0.0, 0.4, 5)
    log = RunLog(time, attributes={"scenario": "made_up", "git_revision": "abc+dirty"})
    log.add("eta", 2.0 * time, "m")
    log.add("xi", np.outer(time, [1.0, -3.0]), "m")
    log.add("tau_d", np.ones((5, 2)), "Nm", ["axis 1", "axis 2"], limits=[100.0, 50.0])
    log.add("mode", np.array([0, 0, 1, 2, 1]), "1", ["free", "surface", "edge"])
    return log


def test_file_has_the_documented_layout(tmp_path):
    make_log().write(tmp_path / "log.h5")
    with h5py.File(tmp_path / "log.h5") as file:
        assert set(file) == {"t", "eta", "xi", "tau_d", "mode"}
        assert file["t"].shape == (5,)
        assert file["t"].attrs["unit"] == "s"
        assert file["eta"].shape == (5, 1)
        np.testing.assert_array_equal(file["xi"][:, 1], -3.0 * file["t"][:])
        assert file["xi"].attrs["unit"] == "m"
        assert list(file["xi"].attrs["labels"]) == ["xi_1", "xi_2"]
        np.testing.assert_array_equal(file["tau_d"].attrs["limits"], [100.0, 50.0])
        assert "limits" not in file["xi"].attrs
        assert np.issubdtype(file["mode"].dtype, np.integer)
        assert dict(file.attrs) == {"scenario": "made_up", "git_revision": "abc+dirty"}


def test_round_trip(tmp_path):
    log = make_log()
    log.write(tmp_path / "log.h5")
    back = RunLog.read(tmp_path / "log.h5")
    np.testing.assert_array_equal(back.time, log.time)
    assert back.attributes == log.attributes
    assert set(back) == set(log) == set(log.signals)
    assert len(back) == len(log)
    for name, signal in log.signals.items():
        np.testing.assert_array_equal(back[name].values, signal.values)
        assert (back[name].unit, back[name].labels) == (signal.unit, signal.labels)
        np.testing.assert_array_equal(back[name].limits, signal.limits)


def test_one_limit_holds_for_all_columns():
    limits = Signal(np.zeros((3, 4)), "Nm", list("abcd"), np.array(7.0)).limits
    np.testing.assert_array_equal(limits, [7.0, 7.0, 7.0, 7.0])


def test_limits_on_both_sides(tmp_path):
    log, ends = RunLog(np.zeros(3)), [[-1.0, 2.0], [-np.inf, 0.5]]
    log.add("q_J", np.zeros((3, 2)), "rad", limits=ends)
    log.write(tmp_path / "log.h5")
    np.testing.assert_array_equal(RunLog.read(tmp_path / "log.h5")["q_J"].limits, ends)


def test_wrong_number_of_samples_is_refused():
    with pytest.raises(ValueError, match="'eta' has 4 samples, time has 5"):
        make_log().add("eta", np.zeros(4), "m")
    with pytest.raises(ValueError, match="'eta'"):
        RunLog(np.zeros(2), {"eta": Signal(np.zeros((3, 1)), "m", ["eta"])})


def test_missing_signal_names_what_there_is():
    with pytest.raises(KeyError, match="no signal 'phi'; it has: eta, xi"):
        make_log()["phi"]


@pytest.mark.parametrize("content", [None, b"not HDF5"])
def test_unreadable_file_is_an_input_error(tmp_path, content):
    path = tmp_path / "log.h5"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(str(path))) as caught:
        RunLog.read(path)
    assert "\n" not in str(caught.value)


def test_file_without_time_is_an_input_error(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.attrs["scenario"] = "other"
    with pytest.raises(InputError, match="not a readable run log"):
        RunLog.read(tmp_path / "log.h5")


def test_standard_attributes():
    attributes = standard_attributes("pfc_elastic_3r")
    assert attributes["scenario"] == "pfc_elastic_3r"
    assert attributes["git_revision"] == git_revision(PROJECT_ROOT)
    for library in ("drake", "casadi", "numpy", "pfsc_drake"):
        assert re.match(r"\d+\.\d+", attributes[f"{library}_version"])
    assert attributes["numpy_version"] == np.__version__


def test_git_revision_of_a_clone(tmp_path):
    def git(*arguments: str) -> str:
        identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
        command = ["git", "-C", str(tmp_path), *identity, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert git_revision(tmp_path) == "unknown"
    git("init")
    assert git_revision(tmp_path) == "unknown"  # no commit yet
    (tmp_path / "a.txt").write_text("1")
    git("add", ".")
    git("commit", "-m", "first")
    revision = git("rev-parse", "HEAD")
    assert git_revision(tmp_path) == revision
    (tmp_path / "untracked.txt").write_text("1")
    assert git_revision(tmp_path) == revision
    (tmp_path / "a.txt").write_text("2")
    assert git_revision(tmp_path) == f"{revision}+dirty"
    (tmp_path / "inner").mkdir()
    assert git_revision(tmp_path / "inner") == "unknown"  # someone else's clone around it
