"""Logs that are fed to an exported controller: what it would have commanded."""

import json
import shutil

import numpy as np
import pytest

from experiments.cli import main
from experiments.controller_replay import check_export, replay_log
from experiments.export import export_scenario
from experiments.results.run_log import RunLog
from experiments.scenario_file import read_scenario
from pfsc_drake.errors import InputError
from tests.compilers import needs_gcc

TICKS, N = 40, 3
LABELS = [f"{name}_{i + 1}" for name in ("q", "v", "q_M", "v_M") for i in range(N)]


def quiet(*_):
    """Tell nobody of progress."""


@pytest.fixture(scope="module", name="exported")
def fixture_exported(tmp_path_factory):
    """Return the folder of a compiled controller of three axes, and its record."""
    folder = tmp_path_factory.mktemp("replay")
    export_scenario(read_scenario("pfc_viscoelastic_3r", []), folder, TICKS * 1e-3, quiet)
    check_export(folder, quiet, "-O0", steps=10)
    return folder, np.fromfile(folder / "replay.bin").reshape(TICKS, -1)


@needs_gcc
def test_the_log_of_a_run(exported, tmp_path):
    folder, recorded = exported
    log = RunLog(1e-3 * np.arange(TICKS))
    for k, name in enumerate(("q_J", "v_J", "q_M", "v_M")):
        log.add(name, recorded[:, k * N : (k + 1) * N], "rad")
    log.add("tau_d", recorded[:, 4 * N : 5 * N] + [0.0, 0.5, -2.0], "Nm")
    log.write(tmp_path / "log.h5")
    commands = replay_log(folder, tmp_path / "log.h5", quiet)
    np.testing.assert_array_equal(commands.values, recorded[:, 4 * N : 5 * N])
    np.testing.assert_allclose(commands.difference, [0.0, 0.5, 2.0], atol=1e-12)
    assert (commands.fault, commands.port, commands.unit) == (0, "drive_torque", "Nm")
    table = np.genfromtxt(commands.file, delimiter=",", names=True)
    np.testing.assert_allclose(table["t"], log.time, atol=1e-12)
    np.testing.assert_allclose(table["drive_torque_3"], commands.values[:, 2], rtol=1e-11)


@needs_gcc
def test_a_log_without_motors_is_one_of_rigid_joints(exported, tmp_path):
    folder, recorded = exported
    inputs = recorded[:, : 2 * N]
    log = RunLog(1e-3 * np.arange(TICKS))
    for name, values in zip(("q_J", "v_J"), np.hsplit(inputs, 2), strict=True):
        log.add(f"{name}_measured", values, "rad")
        log.add(name, np.zeros((TICKS, N)), "rad")
    log.write(tmp_path / "log.h5")
    commands = replay_log(folder, tmp_path / "log.h5", quiet)
    table = write_csv(tmp_path / "same.csv", log.time, np.hstack([inputs, inputs]))
    np.testing.assert_array_equal(
        commands.values, replay_log(folder, tmp_path / table, quiet).values
    )
    assert commands.difference is None


def write_csv(file, times, inputs, labels=LABELS):
    rows = np.column_stack([times, inputs])
    np.savetxt(file, rows, "%.17g", ",", header=",".join(["t", *labels]), comments="")
    return str(file)


@needs_gcc
def test_a_table_of_a_robot_at_its_own_rate(exported, tmp_path):
    """Between its samples the last one holds."""
    folder, recorded = exported
    times, inputs = 5.0 + 1e-3 * np.arange(TICKS), recorded[:, : 4 * N]
    commands = replay_log(folder, tmp_path / write_csv(tmp_path / "all.csv", times, inputs), quiet)
    np.testing.assert_array_equal(commands.values, recorded[:, 4 * N : 5 * N])
    slow = replay_log(
        folder, tmp_path / write_csv(tmp_path / "slow.csv", times[::2], inputs[::2]), quiet
    )
    held = np.repeat(inputs[::2], 2, axis=0)[:-1]
    same = replay_log(
        folder, tmp_path / write_csv(tmp_path / "held.csv", times[: len(held)], held), quiet
    )
    np.testing.assert_array_equal(slow.values, same.values)


@needs_gcc
def test_what_the_command_says(exported, tmp_path, capfd):
    folder, recorded = exported
    inputs = np.tile(recorded[:1, : 4 * N], (TICKS, 1))
    inputs[20:, 1] = 3.0  # a jump of the second joint
    times = 1e-3 * np.arange(TICKS)
    links = write_csv(tmp_path / "links.csv", times, inputs[:, : 2 * N], LABELS[: 2 * N])
    status = main(["replay", str(folder), links])
    said = capfd.readouterr()
    assert status == 3
    assert "drive_torque [Nm], 40 ticks" in said.out
    assert "motors are taken to be where q, v is" in said.out
    assert "largest change" in said.out
    assert said.err.startswith("fault: ")
    assert "from t = 0.0" in said.err


def test_wrong_folders_and_logs(tmp_path):
    with pytest.raises(InputError, match=r"interface\.json: cannot be read; allowed: a folder"):
        replay_log(tmp_path, tmp_path / "a.csv", quiet)
    said = {
        "inputs": [{"name": "joint_state", "size": 4, "unit": ""}],
        "outputs": [
            {"name": "drive_torque", "size": 1, "unit": "Nm"},
            {"name": "fault", "size": 1, "unit": ""},
        ],
        "sampling_time": 1e-3,
    }
    (tmp_path / "interface.json").write_text(json.dumps(said))
    (tmp_path / "a.csv").write_text("t,q_1\n0,1\n")
    with pytest.raises(InputError, match=r"line 1: no column v_1; needed: t, q_1, v_1$"):
        replay_log(tmp_path, tmp_path / "a.csv", quiet)
    (tmp_path / "a.csv").write_text("t,q_1,v_1\n0,1,0\n0,1,0\n")
    with pytest.raises(InputError, match="line 3: t does not grow"):
        replay_log(tmp_path, tmp_path / "a.csv", quiet)
    log = RunLog(np.arange(2.0))
    log.add("q_J", np.zeros((2, 1)), "rad")
    log.write(tmp_path / "log.h5")
    with pytest.raises(InputError, match="no signal v_J, which the controller needs"):
        replay_log(tmp_path, tmp_path / "log.h5", quiet)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ([1], "no mapping"),
        ({"sampling_time": 1e-300}, "sampling_time = 1e-300, not from 1e-6 to 1 s"),
        ({"sampling_time": "1"}, "sampling_time = '1'"),
        ({"inputs": {}}, "no list of inputs"),
        ({"inputs": [{"name": "x", "size": 10**9, "unit": ""}]}, r"inputs\[0\] = "),
        ({"outputs": [{"name": "x", "size": 1}]}, r"outputs\[0\] = "),
        ({"outputs": [{"name": "x", "size": 1, "unit": ""}]}, "no output fault"),
    ],
)
def test_another_interface_is_refused(tmp_path, change, said):
    port = {"name": "fault", "size": 1, "unit": ""}
    good = {"inputs": [port], "outputs": [port], "sampling_time": 1e-3}
    content = good | change if isinstance(change, dict) else change
    (tmp_path / "interface.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=f"interface.json: {said}") as error:
        replay_log(tmp_path, tmp_path / "a.csv", quiet)
    assert str(error.value).endswith("allowed: a file written by export")


@needs_gcc
def test_an_interface_of_another_controller_is_refused(exported, tmp_path):
    folder, recorded = exported
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    said = json.loads((other / "interface.json").read_text())
    said["outputs"][0]["size"] += 1
    (other / "interface.json").write_text(json.dumps(said))
    log = write_csv(tmp_path / "same.csv", 1e-3 * np.arange(TICKS), recorded[:, : 4 * N])
    with pytest.raises(InputError, match="the controller beside it has another number of inputs"):
        replay_log(other, tmp_path / log, quiet)
