"""The door to C: a diagram of blocks, written with a record that C repeats."""

import json
import subprocess

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder

from pfsc_drake import InputError, export
from pfsc_drake.systems.block_system import BlockSystem
from tests.codegen.test_c_controller import Damper
from tests.compilers import needs_gcc

INPUTS = {"joint_state": np.random.default_rng(2).normal(size=(20, 4)), "gain": np.ones((20, 1))}


def diagram(*, more=None):
    builder = DiagramBuilder()
    damper = builder.AddNamedSystem("damper", BlockSystem(Damper(), 2e-3))
    for name in ("joint_state", "gain"):
        builder.ExportInput(damper.GetInputPort(name), name)
    for name in ("drive_torque", "int", "fault"):
        builder.ExportOutput(damper.GetOutputPort(name), name)
    if more is not None:
        builder.AddSystem(more)
    built = builder.Build()
    built.set_name("damper")
    return built


def test_what_is_written(tmp_path):
    exported = export(diagram(), tmp_path / "new")
    said = json.loads((tmp_path / "new" / "interface.json").read_text(encoding="utf-8"))
    assert said == exported.interface()
    assert said["sampling_time"] == 2e-3
    assert [port["name"] for port in said["inputs"]] == ["joint_state", "gain"]
    names = {file.name for file in (tmp_path / "new").iterdir()}
    assert {"main_rt.c", "replay.c", "Makefile", "CMakeLists.txt", "README.md"} <= names
    assert "replay.bin" not in names


@needs_gcc
def test_c_repeats_the_record(tmp_path):
    export(diagram(), tmp_path, INPUTS)
    assert (tmp_path / "replay.bin").stat().st_size == 20 * 8 * (5 + 5)
    subprocess.run(["make", "--silent"], cwd=tmp_path, check=True)
    repeated = []
    for command in (["replay", "replay.bin", "10"], ["replay_random", "replay.bin", "2000"]):
        done = subprocess.run(
            [f"./{command[0]}", *command[1:]], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout
        repeated.append(done.stdout)
    assert "faults" in done.stdout
    # one number that is another is found
    record = np.fromfile(tmp_path / "replay.bin").reshape(20, 10)
    record[7, 5] += 1e-9
    record.tofile(tmp_path / "other.bin")
    command = ["./replay", "other.bin", "10"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert "first difference: tick 7, number 0 of the outputs" in done.stdout
    assert "ticks 20 differing 1 largest 1e-09 " in done.stdout
    assert "ticks 20 differing 0 largest 0 " in repeated[0]


def test_a_record_has_the_order_of_the_interface(tmp_path):
    """Whatever order its inputs are given in."""
    turned = {name: INPUTS[name] for name in ("gain", "joint_state")}
    export(diagram(), tmp_path, turned)
    record = np.fromfile(tmp_path / "replay.bin").reshape(20, 10)
    np.testing.assert_array_equal(record[:, :4], INPUTS["joint_state"])
    np.testing.assert_array_equal(record[:, 5:7], -INPUTS["joint_state"][:, 2:])


def test_the_header_says_what_interface_json_does(tmp_path):
    export(diagram(), tmp_path)
    said = json.loads((tmp_path / "interface.json").read_text(encoding="utf-8"))
    assert [port["unit"] for port in said["outputs"]] == ["Nm", "", ""]
    header = (tmp_path / "controller.h").read_text(encoding="utf-8")
    for line in (
        "#define CONTROLLER_SAMPLING_TIME 0.002 /* s */",
        "#define CONTROLLER_DRIVES 2 /*",
        "    double joint_state[4]; /* rad, rad/s */",
        "    double drive_torque[2]; /* Nm */",
    ):
        assert line in header


@needs_gcc
def test_the_loop_with_deadlines(tmp_path):
    """With or without the right to a real-time priority."""
    export(diagram(), tmp_path, INPUTS)
    subprocess.run(["make", "--silent", "main_rt"], cwd=tmp_path, check=True)
    done = subprocess.run(["./main_rt"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert "no more inputs after 20 ticks" in done.stdout
    assert "worst" in done.stdout
    record = np.fromfile(tmp_path / "replay.bin").reshape(20, 10)
    record[7, 0] = np.nan
    record.tofile(tmp_path / "bad.bin")
    command = ["./main_rt", "0.03", "bad.bin"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 3
    assert "fault 3" in done.stdout
    assert "no more inputs" not in done.stdout


def test_what_is_no_block_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"^diagram damper: must consist of blocks"):
        export(diagram(more=Adder(2, 1)), tmp_path)
