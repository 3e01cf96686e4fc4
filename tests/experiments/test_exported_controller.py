"""Controllers in C from scripts: what a call gives, and what it refuses."""

import numpy as np
import pytest

import experiments.export
from experiments import ExportedController, export_controller, run
from pfsc_drake import InputError
from tests.compilers import needs_gcc

SCENARIO = "pfc_viscoelastic_3r"


@pytest.fixture(scope="module", name="controller")
def fixture_controller(tmp_path_factory):
    return export_controller(
        SCENARIO,
        {"reference.velocity": 1.2},
        out=tmp_path_factory.mktemp("export") / "new",
        duration=0.02,
        quiet=True,
    )


def test_what_a_call_gives(controller):
    assert isinstance(controller, ExportedController)
    assert controller.check is None
    assert controller.folder / "controller.h" in controller.files
    said = controller.interface
    assert said["scenario"] == SCENARIO and said["sampling_time"] == 1e-3
    assert [(port["name"], port["size"]) for port in said["inputs"]] == [("joint_state", 12)]


@pytest.mark.slow
@needs_gcc
def test_what_it_would_have_told_the_drives(controller, monkeypatch):
    monkeypatch.setenv("MAKEFLAGS", "OPTIMIZATION=-O0")
    simulated = run(
        SCENARIO,
        {"reference.velocity": 1.2},
        duration=0.03,
        figures=False,
        recording=False,
        quiet=True,
    )
    commands = controller.replay(simulated, quiet=True)
    np.testing.assert_array_equal(commands.values, simulated.log["tau_d"].values)
    same = controller.replay(simulated.folder / "log.h5", quiet=True)
    np.testing.assert_array_equal(commands.values, same.values)
    assert commands.difference.max() == 0.0


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan])
def test_durations_that_are_none(duration, tmp_path):
    with pytest.raises(InputError, match=r"duration = .*; allowed: a positive number"):
        export_controller(SCENARIO, out=tmp_path / "out", duration=duration)
    assert not (tmp_path / "out").exists()


def test_a_check_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setattr(experiments.export, "missing_tool", lambda: "gcc")
    with pytest.raises(InputError, match="check = True: there is no gcc here"):
        export_controller(SCENARIO, out=tmp_path / "out", check=True)
    assert not (tmp_path / "out").exists()
