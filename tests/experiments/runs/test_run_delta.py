"""The DELTA scenario through the command line, shortened to its first part."""

import json

import h5py
import numpy as np
import pytest

from experiments.cli import main

COULOMB = 5.0  # N, of models/festo_expt_45
VISCOUS = 12.0  # N s/m
DWELL = 0.5  # s
END = 1.8  # s, drive 1 has reversed twice by then


@pytest.fixture(scope="module", params=[True, False], ids=["friction", "no friction"])
def run(request, tmp_path_factory):
    out = tmp_path_factory.mktemp("delta") / "out"
    change = f"drive_friction={str(request.param).lower()}"
    arguments = ["run", "pfc_delta", "--out", str(out), "--duration", str(END), "--set", change]
    assert main([*arguments, "--no-figures"]) == 0
    with h5py.File(out / "log.h5") as file:
        log = {name: dataset[:] for name, dataset in file.items()}
        units = {name: dataset.attrs.get("unit") for name, dataset in file.items()}
    return request.param, out, log, units


@pytest.mark.slow
def test_deviation(run):
    friction, out, log, _ = run
    late = log["t"] >= DWELL
    assert np.linalg.norm(log["xi"][0]) == pytest.approx(0.010, abs=1e-7)
    assert np.linalg.norm(log["xi"][late], axis=1).max() < (0.5e-3 if friction else 0.01e-3)
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    deviation = np.linalg.norm(log["xi"][late], axis=1).max()
    assert metrics["max_path_deviation"]["value"] == pytest.approx(deviation)
    assert metrics["saturated_samples"]["value"] == 0


@pytest.mark.slow(but="friction")
def test_drives_are_slides(run):
    _, out, log, units = run
    assert (units["q_J"], units["v_J"], units["tau_d"]) == ("m", "m/s", "N")
    assert "q_M" not in log  # stiff drives have no coordinates of their own
    assert (out / "recording.html").stat().st_size > 100_000


@pytest.mark.slow
def test_deviations_come_from_sticking(run):
    """Sec. 3.8.1: the largest deviations follow drives whose velocity changes its sign."""
    friction, _, log, units = run
    if not friction:
        assert "tau_f" not in log
        return
    assert units["tau_f"] == "N"
    t, v, tau_f = log["t"], log["v_J"], log["tau_f"]
    moving = np.abs(v) > 0.01
    np.testing.assert_allclose(
        tau_f[moving], (COULOMB * np.sign(v) + VISCOUS * v)[moving], atol=1e-9
    )
    stuck = (np.abs(v) < 1e-3) & (np.abs(tau_f) < 0.98 * COULOMB)
    distance = np.linalg.norm(log["xi"], axis=1)
    # drive 1 reverses, sticks for a moment, and the tool is off the path just after
    for begin in (1.0, 1.5):
        window = (t > begin) & (t < begin + 0.3)
        stops = t[window & stuck[:, 0]]
        assert len(stops) > 10
        peak = t[window][np.argmax(distance[window])]
        assert stops[0] < peak < stops[-1] + 0.1
        assert distance[window].max() > 0.15e-3
