"""Controllers in C: compiled with all warnings, and the same as in Python to the last bit."""

import ctypes
import json
import subprocess

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.cases import all_finite, latch, where
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.codegen.c_controller import CController, CFault
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from tests.compilers import needs_gcc

WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
FLAGS = ["-std=c99", "-O1", *WARNINGS, "-shared", "-fPIC"]


class Damper(Block):
    """A torque against the velocity, off after an input that is not finite; and its sum."""

    def __init__(self):
        self.inputs = {"joint_state": Port(4, "rad, rad/s"), "gain": Port(1)}
        self.outputs = {"drive_torque": Port(2, "Nm"), "int": Port(2), "fault": Port(1)}
        self.states = {"sum": 2, "fault": 1, "set": 1}

    def initial(self, u, t):
        return {"sum": u.joint_state[:2]}

    def output(self, x, u, t):
        fault = latch(x.fault, where(all_finite(u.joint_state, u.gain), 0.0, 3.0))
        torque = where(fault, 0.0, -u.gain * u.joint_state[2:] + x.set)
        return {"drive_torque": torque, "int": x.sum + t, "fault": fault}

    def update(self, x, u, y, t):
        return {"sum": x.sum + y.drive_torque, "fault": y.fault}


@pytest.fixture(name="controller")
def fixture_controller():
    network = Network.of(Damper())
    return CController.of(network, 1e-3, presets={"set": np.array([0.5])}, scenario="damper")


def test_the_interface_says_what_there_is(controller, tmp_path):
    controller.write(tmp_path)
    interface_data = json.loads((tmp_path / "interface.json").read_text(encoding="utf-8"))
    assert interface_data["inputs"] == [
        {"name": "joint_state", "size": 4, "unit": "rad, rad/s"},
        {"name": "gain", "size": 1, "unit": ""},
    ]
    assert [port["name"] for port in interface_data["outputs"]] == ["drive_torque", "int", "fault"]
    assert interface_data["sampling_time"] == 1e-3
    assert interface_data["state_bytes"] == 8 * (2 + 4)
    assert interface_data["scenario"] == "damper"


@pytest.mark.parametrize(
    ("turning", "joints", "drives"),
    [
        ((True, True), "rad, rad/s", "Nm"),
        ((False, False), "m, m/s", "N"),
        ((True, False), "rad, rad/s or m, m/s", "Nm or N"),
        ((), "rad, rad/s or m, m/s", "Nm or N"),
    ],
)
def test_units_are_those_of_the_joints(turning, joints, drives):
    block = Damper()
    block.inputs = block.inputs | {"joint_state": Port(4, "rad, rad/s or m, m/s")}
    block.outputs = block.outputs | {"drive_torque": Port(2, "Nm or N")}
    interface_data = CController.of(Network.of(block), 1e-3, turning=turning).interface()
    assert (interface_data["inputs"][0]["unit"], interface_data["outputs"][0]["unit"]) == (
        joints,
        drives,
    )


@needs_gcc
def test_c_is_python_to_the_last_bit(controller, tmp_path):
    controller.write(tmp_path)
    sources = [str(file) for file in tmp_path.glob("*.c")]
    library = tmp_path / "controller.so"
    subprocess.run(["gcc", *FLAGS, "-o", str(library), *sources, "-lm"], check=True)
    c = ctypes.CDLL(str(library))
    state = (ctypes.c_double * 6)()
    stepper = Stepper(Network.of(Damper()))
    rng = np.random.default_rng(5)
    for k in range(30):
        u, y = rng.normal(size=5), np.zeros(5)
        if k == 20:
            u[1] = np.inf
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (u, y)]
        if k == 0:
            c.controller_initialize(state, pointers[0])
            stepper.start(joint_state=u[:4], gain=u[4:])
            stepper.set_state("set", [0.5])
        fault = c.controller_step(state, *pointers)
        expected = stepper.step(joint_state=u[:4], gain=u[4:])
        np.testing.assert_array_equal(y, np.concatenate(list(expected.values())))
        assert fault == (3 if k >= 20 else 0)
        assert np.any(y[:2] != 0.0) == (k < 20)


class Broken(Damper):
    """The like with a status, and a fault that a NaN among its inputs makes one."""

    def __init__(self):
        super().__init__()
        self.outputs["status"] = Port(3)

    def output(self, x, u, t):
        found = super().output(x, u, t)
        return found | {"fault": u.joint_state[3], "status": ca.vertcat(u.joint_state[3], 7.0, t)}

    def update(self, x, u, y, t):
        return {"sum": x.sum + u.joint_state[:2]}


@pytest.fixture(name="sanitized", scope="module")
def fixture_sanitized(tmp_path_factory):
    """A program that reads calls and prints what they give, where undefined behaviour aborts."""
    folder = tmp_path_factory.mktemp("sanitized")
    CController.of(Network.of(Broken()), 1e-3).write(folder)
    (folder / "calls.c").write_text(CALLS, encoding="utf-8")
    sources = [str(file) for file in folder.glob("*.c")]
    flags = ["-std=c99", "-O1", *WARNINGS, "-fsanitize=undefined", "-fno-sanitize-recover=all"]
    subprocess.run(["gcc", *flags, "-o", str(folder / "calls"), *sources, "-lm"], check=True)

    def run(*calls):
        """Return fault, drives, port fault and status of each step, shape (steps, 6)."""
        words = [word for name, *values in calls for word in (name, *map(repr, values))]
        done = subprocess.run(
            [folder / "calls", *words], capture_output=True, text=True, check=True
        )
        return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)

    return run


CALLS = r"""
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "controller.h"
int main(int argc, char **argv)
{
    controller_state state;
    controller_inputs inputs;
    controller_outputs outputs;
    int i, fault, k;
    memset(&state, 0xa5, sizeof state);
    memset(&inputs, 0, sizeof inputs);
    inputs.gain[0] = 2.0;
    for (i = 1; i + 2 < argc; i += 3) {
        k = argv[i][1] == 'v' ? 3 : 1;
        inputs.joint_state[k] = strtod(argv[i + 1], NULL);
        inputs.joint_state[2] = strtod(argv[i + 2], NULL);
        if (argv[i][0] == 'i') {
            controller_initialize(&state, &inputs);
        } else {
            fault = controller_step(&state, &inputs, &outputs);
            printf("%d %g %g %g %g %g\\n", fault, outputs.drive_torque[0], outputs.drive_torque[1],
                   outputs.fault[0], outputs.status[0], outputs.status[1]);
        }
    }
    return 0;
}
""".replace("\\\\n", "\\n")
NAN, GOOD = float("nan"), ("s", 0.1, 0.5)


@needs_gcc
def test_good_calls_are_no_fault(sanitized):
    np.testing.assert_array_equal(sanitized(("i", 0.1, 0.0), GOOD), [[0, -1.0, 0, 0, 0, 7]])


@needs_gcc
def test_a_step_before_the_start_is_a_fault(sanitized):
    """Until there is one; memory holds anything."""
    found = sanitized(GOOD, GOOD, ("i", 0.1, 0.0), GOOD)
    np.testing.assert_array_equal(found[:2], [[101, 0, 0, 101, 101, 0]] * 2)
    np.testing.assert_array_equal(found[2], [0, -1.0, 0, 0, 0, 7])


@needs_gcc
@pytest.mark.parametrize("bad", [NAN, float("inf"), -1e300, 1.1e9])
def test_a_start_that_is_none_is_a_fault(sanitized, bad):
    found = sanitized(("i", bad, 0.0), GOOD, GOOD, ("i", -0.9e9, 0.0), GOOD)
    np.testing.assert_array_equal(found[:2], [[102, 0, 0, 102, 102, 0]] * 2)
    assert found[2, 0] == 0.0


@needs_gcc
@pytest.mark.parametrize("bad", [NAN, float("inf"), -1.0, 101.0, 1e300])
def test_a_fault_that_is_no_number_of_one_is_a_fault(sanitized, bad):
    """And stays, though later ones are; (int) of NaN is whatever a processor makes of it."""
    found = sanitized(("i", 0.1, 0.0), ("sv", bad, 0.5), ("sv", 0.0, 0.5))
    np.testing.assert_array_equal(found, [[103, 0, 0, 103, 103, 0]] * 2)
    assert sanitized(("i", 0.1, 0.0), ("sv", 16.0, 0.5))[0, 0] == 16.0


def test_every_fault_has_a_sentence(controller, tmp_path):
    controller.write(tmp_path)
    interface_data = json.loads((tmp_path / "interface.json").read_text(encoding="utf-8"))["faults"]
    assert (
        interface_data["0"] == "no fault"
        and "before controller_initialize" in interface_data["101"]
    )
    assert {*map(int, interface_data)} == {*Fault, *CFault}
    assert max(Fault) < min(CFault)


def test_what_has_no_fault_is_no_controller():
    class Silent(Damper):
        def __init__(self):
            super().__init__()
            del self.outputs["fault"]

        def output(self, x, u, t):
            found = super().output(x, u, t)
            del found["fault"]
            return found

        def update(self, x, u, y, t):
            return {}

    with pytest.raises(InputError, match=r"^export: outputs drive_torque, int .* must be fault"):
        CController.of(Network.of(Silent()), 1e-3)


class Looked(Block):
    """A number of a table."""

    expands = False
    inputs, outputs, states = {"place": Port(1)}, {"value": Port(1), "fault": Port(1)}, {}

    def output(self, x, u, t):
        table = ca.MX(ca.DM(np.random.default_rng(0).normal(size=50)))
        return {"value": table[u.place], "fault": 0.0}


def test_tables_take_eight_bytes_a_number():
    assert CController.of(Network.of(Looked()), 1e-3).table_bytes == 8 * 50
