"""Controllers of shipped scenarios in C: compiled, and a run repeated to the last bit."""

import ctypes
import json
import shutil
import subprocess

import numpy as np
import pytest

from experiments.catalog.scenario_file import read_scenario
from experiments.export import check_export, export_scenario, record

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")
TICKS = 40


def exported(name, folder, *overrides):
    export = export_scenario(read_scenario(name, list(overrides)), folder, lambda *_: None)
    return export, record(export, TICKS * export.part.period)


@pytest.fixture(scope="session", name="elastic")
def fixture_elastic(tmp_path_factory):
    folder = tmp_path_factory.mktemp("elastic") / "new"
    return folder, *exported("pfc_elastic_6r", folder)


def test_what_is_written_and_said(elastic):
    folder, export, recorded = elastic
    assert {file.name for file in export.files} == {file.name for file in folder.iterdir()} - {
        "replay",
        "replay.bin",
    }
    said = json.loads((folder / "interface.json").read_text(encoding="utf-8"))
    assert [(port["name"], port["size"]) for port in said["inputs"]] == [("joint_state", 24)]
    names = ["drive_torque", "manifold_state", "status", "fault", "reference"]
    assert [port["name"] for port in said["outputs"]] == names
    assert recorded.shape == (TICKS, 24 + sum(port["size"] for port in said["outputs"]))
    assert "joint_state" in (folder / "README.md").read_text(encoding="utf-8")


@needs_gcc
def test_c_repeats_a_run_to_the_last_bit(elastic):
    folder, _, recorded = elastic
    replay = check_export(folder, recorded, "-O0")
    assert (replay.ticks, replay.differing) == (TICKS, 0)
    recorded = recorded.copy()
    recorded[7, 24] = np.nextafter(recorded[7, 24], np.inf)
    recorded.tofile(folder / "replay.bin")
    found = subprocess.run(["./replay"], cwd=folder, capture_output=True, text=True, check=False)
    assert found.returncode == 1
    assert found.stdout.startswith("first difference: tick 7, number 0 of the outputs")


@needs_gcc
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_no_measurement_ends_in_a_fault(elastic, library, bad):
    _, export, recorded = elastic
    inputs = np.ascontiguousarray(recorded[:, :24])
    outputs = np.zeros(recorded.shape[1] - 24)
    state = (ctypes.c_double * (export.controller.interface()["state_bytes"] // 8))()
    library.controller_initialize(state, pointer(inputs[0]))
    for k in range(20):
        u = inputs[k].copy()
        if k == 10:
            u[2] = bad
        fault = library.controller_step(state, pointer(u), pointer(outputs))
        assert (fault != 0) == (k >= 10)
        assert np.isfinite(outputs[:6]).all()


@pytest.fixture(scope="session", name="library")
def fixture_library(elastic, tmp_path_factory):
    folder = elastic[0]
    library = tmp_path_factory.mktemp("library") / "controller.so"
    sources = ["controller.c", "controller_functions.c"]
    command = ["gcc", "-O0", "-std=c99", "-shared", "-fPIC", "-o", str(library), *sources, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(library))


def pointer(values):
    return values.ctypes.data_as(ctypes.c_void_p)
