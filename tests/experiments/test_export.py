"""Controllers of shipped scenarios in C: compiled, and a run repeated to the last bit."""

import ctypes
import json
import subprocess

import numpy as np
import pytest

from experiments.controller_replay import check_export, replay_log
from experiments.export import export_scenario
from experiments.results.run_log import RunLog
from experiments.scenario_file import read_scenario
from tests.compilers import needs_gcc

TICKS = 40
ARM = "pfc_elastic_6r"
# velocity servos and guidance with a force measured late; a redundant arm; a surface and a
# discrete plant, which steps at a tick before
OTHERS = {
    "vf_forbidden_region": ["sensor.delay=0.002"],
    "pfc_panda_7r": [],
    "sfc_delta_cylinder": [],
}


def quiet(*_):
    """Tell nobody of progress."""


def exported(name, folder, changes=()):
    scenario = read_scenario(name, list(changes))
    controller, files = export_scenario(scenario, folder, TICKS * 1e-3, quiet)
    assert {file.name for file in files} <= {file.name for file in folder.iterdir()}
    return controller, np.fromfile(folder / "replay.bin").reshape(TICKS, -1)


@pytest.fixture(scope="session", name="elastic")
def fixture_elastic(tmp_path_factory):
    folder = tmp_path_factory.mktemp("elastic") / "new"
    return folder, *exported(ARM, folder)


def test_what_is_written_and_said(elastic):
    folder, _, recorded = elastic
    said = json.loads((folder / "interface.json").read_text(encoding="utf-8"))
    assert [(port["name"], port["size"]) for port in said["inputs"]] == [("joint_state", 24)]
    names = ["drive_torque", "manifold_state", "status", "fault", "reference"]
    assert [port["name"] for port in said["outputs"]] == names
    assert (said["scenario"], said["hash"]) == (ARM, read_scenario(ARM, []).fingerprint)
    assert recorded.shape == (TICKS, 24 + sum(port["size"] for port in said["outputs"]))
    assert "joint_state" in (folder / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow
@needs_gcc
def test_c_repeats_a_run_to_the_last_bit(elastic):
    folder, _, recorded = elastic
    replay = check_export(folder, quiet, "-O0", steps=10)
    assert (replay.ticks, replay.differing) == (TICKS, 0)
    other = recorded.copy()
    other[7, 24] = np.nextafter(other[7, 24], np.inf)
    other.tofile(folder / "other.bin")
    command = ["./replay", "other.bin", "10"]
    found = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert found.returncode == 1
    assert found.stdout.startswith("first difference: tick 7, number 0 of the outputs")


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("name", OTHERS)
def test_c_repeats_runs_of_other_kinds(name, tmp_path):
    controller, recorded = exported(name, tmp_path, OTHERS[name])
    wrench = ["measured_wrench"] if name.startswith("vf") else []
    inputs = [port["name"] for port in controller.interface()["inputs"]]
    assert inputs == ["joint_state", *wrench]
    replay = check_export(tmp_path, quiet, "-O0", steps=10)
    assert (replay.ticks, replay.differing) == (TICKS, 0)
    assert np.ptp(recorded, axis=0).max() > 0.0


def assert_torques_are_fed_from_a_log(folder, recorded):
    log = RunLog(1e-3 * np.arange(TICKS))
    names = ("q_J_measured", "v_J_measured", "q_M_measured", "v_M_measured", "tau_J_measured")
    for k, name in enumerate(names):
        log.add(name, recorded[:, 6 * k : 6 * k + 6])
    log.write(folder / "log.h5")
    told = replay_log(folder, folder / "log.h5", quiet).values
    np.testing.assert_array_equal(told, recorded[:, 30:36])


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize(
    ("sides", "state", "torque"),
    [("motor", "observed", []), ("motor_and_torque", "from_torque", ["joint_torque"])],
)
def test_deviations_of_links_that_are_found_are_told_in_c(sides, state, torque, tmp_path):
    changes = [f"encoders.sides={sides}", f"controller.state={state}"]
    controller, recorded = exported(ARM, tmp_path, changes)
    said = controller.interface()
    assert [port["name"] for port in said["inputs"]] == ["joint_state", *torque]
    told = {port["name"]: port["size"] for port in said["outputs"]}
    expected = {"position_deviation": 6, "tool_deviation": 3}
    expected |= {"velocity_deviation": 6} if torque else {}
    assert {name: told[name] for name in list(told)[5:]} == expected
    replay = check_export(tmp_path, quiet, "-O0", steps=10)
    assert (replay.ticks, replay.differing) == (TICKS, 0)
    assert np.all(recorded[:, -sum(expected.values()) :] > 0.0)
    if torque:
        assert_torques_are_fed_from_a_log(tmp_path, recorded)


@needs_gcc
def test_wrong_inputs_end_in_a_fault(elastic):
    folder = elastic[0]
    build = ["make", "--silent", "OPTIMIZATION=-O0", "replay_random"]
    subprocess.run(build, cwd=folder, check=True)
    command = ["./replay_random", "replay.bin", "3000"]
    found = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout
    assert int(found.stdout.split()[-1]) > 50


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_no_measurement_ends_in_a_fault(elastic, library, bad):
    """And the drives go on with what held the robot: it rests."""
    _, controller, recorded = elastic
    inputs = np.ascontiguousarray(recorded[:, :24])
    outputs = np.zeros(recorded.shape[1] - 24)
    state = (ctypes.c_double * (controller.interface()["state_bytes"] // 8))()
    library.controller_initialize(state, pointer(inputs[0]))
    for k in range(20):
        before, u = outputs[:6].copy(), inputs[k].copy()
        if k == 10:
            u[2] = bad
        fault = library.controller_step(state, pointer(u), pointer(outputs))
        assert (fault != 0) == (k >= 10)
        if k >= 10:
            np.testing.assert_allclose(outputs[:6], before, rtol=0.01, atol=1.0)


@pytest.fixture(scope="session", name="library")
def fixture_library(elastic, tmp_path_factory):
    folder = elastic[0]
    library = tmp_path_factory.mktemp("library") / "controller.so"
    sources = sorted(file.name for file in folder.glob("controller*.c"))
    command = ["gcc", "-O0", "-std=c99", "-shared", "-fPIC", "-o", str(library), *sources, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(library))


def pointer(values):
    return values.ctypes.data_as(ctypes.c_void_p)
