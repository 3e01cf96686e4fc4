"""The exact elastic law under a force that it knows, measures, or knows nothing of."""

import h5py
import numpy as np
import pytest

from experiments.cli import main

pytestmark = pytest.mark.slow

PUSH = ("hold_back={begin: 0.25, end: 0.55, force: -180, ramp: 0.1}", "start.offset=[0, 0]")


def run(tmp_path, *changes):
    """Return exit status, distance from the path [m] and the log."""
    out = tmp_path / "out"
    arguments = ["run", "pfc_comau_6r_elastic", "--out", str(out), "--duration", "0.6"]
    for change in ("start.rotation_deg=[0, 0, 0]", *PUSH, *changes):
        arguments += ["--set", change]
    status = main([*arguments, "--no-figures", "--no-recording"])
    with h5py.File(out / "log.h5") as file:
        log = {name: dataset[:] for name, dataset in file.items()}
    return status, np.linalg.norm(log["xi"], axis=1), log


@pytest.mark.parametrize("source", ["known", "measured"])
def test_a_force_that_is_known_of_moves_nothing(tmp_path, source):
    status, distance, log = run(tmp_path, f"controller.external_torque.source={source}")
    assert status == 0
    assert np.abs(log["wrench_ext"]).max() > 100.0
    assert distance.max() < 1e-3
    assert np.abs(log["eta"] - log["eta_p"]).max() < 5e-3


def test_a_force_that_is_not_known_of_leads_astray(tmp_path, capsys):
    status, distance, _ = run(tmp_path, "controller.external_torque.source=none")
    assert status == 3
    # the fast pair of poles bears it, as it bears a wrong model
    assert 5e-4 < distance.max() < 3e-3
    assert "deflections of the joints" in capsys.readouterr().out.replace("\n", " ")


def test_servos_bear_forces_themselves(tmp_path, capsys):
    arguments = ["run", "pfc_compliant_6r", "--out", str(tmp_path / "out")]
    changes = ["controller.law=velocity_servo", "controller.external_torque.source=measured"]
    assert main([*arguments, "--set", changes[0], "--set", changes[1]]) == 2
    assert "controller.external_torque.source = measured" in capsys.readouterr().err
