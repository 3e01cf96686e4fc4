"""The compliant scenario through the command line, shortened: pushed while it moves."""

import h5py
import numpy as np
import pytest

from experiments.cli import main

BARE = ("--no-figures", "--no-recording")
FORCE, STIFFNESS = 40.0, 2000.0
PUSH = f"forces=[{{begin: 0.5, end: 1.7, ramp: 0.05, frame: manifold, force: [0, {FORCE}, 0]}}]"


@pytest.fixture(scope="module", params=["rigid", "velocity_servo"])
def log(request, tmp_path_factory):
    out = tmp_path_factory.mktemp("compliant") / "out"
    changes = ["--set", f"controller.law={request.param}", "--set", PUSH]
    arguments = ["run", "pfc_compliant_6r", "--out", str(out), "--duration", "1.6", *BARE]
    assert main([*arguments, *changes]) == 0
    with h5py.File(out / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}


@pytest.mark.slow
def test_the_reference_yields_as_a_spring(log):
    t = log["t"]
    assert log["eta_p"][t > 1.0].min() > log["eta_p"][0] + 0.05  # it moves
    late = (t > 1.5) & (t < 1.6)
    np.testing.assert_allclose(log["xi_p"][late, 0], FORCE / STIFFNESS, rtol=0.02)
    assert np.abs(log["xi_p"][:, 1]).max() < 1e-4


@pytest.mark.slow
def test_the_tool_follows_the_yielding_reference(log):
    assert np.abs(log["xi"] - log["xi_p"]).max() < 1e-3


@pytest.mark.slow
def test_nothing_moves_while_taring(log):
    """The scenario's bias of 12 N would deflect by 6 mm."""
    rest = log["t"] < 0.29
    assert np.abs(log["y_t"][rest] - log["y_t"][0]).max() < 5e-4
    first = log["t"] < 0.05
    # no more than the encoders' increments let it
    assert np.abs(log["y_t"][first] - log["y_t"][0]).max() < 5e-6
    # where the encoders see the tool
    assert np.abs(log["xi_p"][first]).max() < 1e-6
