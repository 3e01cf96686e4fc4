"""Export to C: a diagram of blocks, written with a record that C repeats."""

import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder

from pfsc_drake import InputError, export
from pfsc_drake.blocks.network import Network
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.codegen.c_project import check_project, write_project
from pfsc_drake.codegen.manifest import manifest_text
from pfsc_drake.systems.block_system import BlockSystem
from tests.codegen.test_c_controller import Damper
from tests.compilers import needs_gcc

INPUTS = {"joint_state": np.random.default_rng(2).normal(size=(20, 4)), "gain": np.ones((20, 1))}


@pytest.fixture(name="controller")
def fixture_controller():
    return CController.of(Network.of(Damper()), 1e-3)


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
    interface_data = json.loads((tmp_path / "new" / "interface.json").read_text(encoding="utf-8"))
    assert interface_data == exported.interface()
    assert interface_data["sampling_time"] == 2e-3
    assert [port["name"] for port in interface_data["inputs"]] == ["joint_state", "gain"]
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
    interface_data = json.loads((tmp_path / "interface.json").read_text(encoding="utf-8"))
    assert [port["unit"] for port in interface_data["outputs"]] == ["Nm", "", ""]
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


FOREIGN = ["README.md", "Makefile", "CMakeLists.txt", "controller.c", "manifest.json", "main_rt.c"]


@pytest.mark.parametrize("name", FOREIGN)
def test_files_of_the_user_are_never_replaced(controller, tmp_path, name):
    (tmp_path / name).write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=rf"holds {name}, which no export has written; allowed"):
        write_project(controller, tmp_path)
    with pytest.raises(InputError, match=rf"holds {name}, which no export has written; allowed"):
        check_project(tmp_path)
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {name: "mine"}


def test_an_export_replaces_an_earlier_one_and_nothing_else(controller, tmp_path):
    write_project(controller, tmp_path, np.zeros((2, 3)))
    (tmp_path / "commands.csv").write_text("mine", encoding="utf-8")
    changed = replace(controller, title="Another")
    check_project(tmp_path)
    files = write_project(changed, tmp_path, np.ones((2, 3)))
    assert "Another" in (tmp_path / "README.md").read_text(encoding="utf-8")
    assert np.fromfile(tmp_path / "replay.bin").tolist() == [1.0] * 6
    assert {file.name for file in tmp_path.iterdir()} == {
        "commands.csv",
        *(file.name for file in files),
    }


def test_drivers_that_the_user_wrote_into_a_file_of_an_export_stay(controller, tmp_path):
    """The README asks for that."""
    write_project(controller, tmp_path)
    file = tmp_path / "main_rt.c"
    file.write_text(file.read_text() + "/* my drivers */", encoding="utf-8")
    with pytest.raises(InputError, match=r"its main_rt.c has been changed since the export"):
        write_project(controller, tmp_path)
    assert file.read_text().endswith("/* my drivers */")
    file.rename(tmp_path / "mine.c")
    write_project(controller, tmp_path)
    assert file.exists() and (tmp_path / "mine.c").exists()


def test_results_links_and_files_are_no_folder_for_an_export(controller, tmp_path):
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"is no folder"):
        write_project(controller, tmp_path / "file")
    write_project(controller, tmp_path / "out")
    (tmp_path / "out" / "README.md").rename(tmp_path / "moved.md")
    (tmp_path / "out" / "README.md").symlink_to(tmp_path / "moved.md")
    with pytest.raises(InputError, match=r"holds README.md, which no export has written"):
        write_project(controller, tmp_path / "out")
    run = tmp_path / "run"
    run.mkdir()
    (run / "manifest.json").write_text(manifest_text("run", ["log.h5"]), encoding="utf-8")
    with pytest.raises(InputError, match=r"holds the results of a run; allowed: another folder"):
        write_project(controller, run)


def test_a_folder_without_a_name_is_refused():
    with pytest.raises(InputError, match=r"^folder = ''; allowed: a folder"):
        export(diagram(), "")
