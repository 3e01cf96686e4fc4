"""Controllers in C: compiled with all warnings, and the same as in Python to the last bit."""

import ctypes
import json
import subprocess

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.cases import all_finite, latched, where
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.errors import InputError
from tests.compilers import needs_gcc

WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
FLAGS = ["-std=c99", "-O1", *WARNINGS, "-shared", "-fPIC"]


class Damper(Block):
    """A torque against the velocity, off after an input that is no number; and a sum of it."""

    def __init__(self):
        self.inputs = {"joint_state": Port(4, "rad, rad/s"), "gain": Port(1)}
        self.outputs = {"drive_torque": Port(2, "Nm"), "int": Port(2), "fault": Port(1)}
        self.states = {"sum": 2, "fault": 1, "set": 1}

    def initial(self, u, t):
        return {"sum": u.joint_state[:2]}

    def output(self, x, u, t):
        fault = latched(x.fault, where(all_finite(u.joint_state, u.gain), 0.0, 3.0))
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
    said = json.loads((tmp_path / "interface.json").read_text(encoding="utf-8"))
    assert said["inputs"] == [
        {"name": "joint_state", "size": 4, "unit": "rad, rad/s"},
        {"name": "gain", "size": 1, "unit": ""},
    ]
    assert [port["name"] for port in said["outputs"]] == ["drive_torque", "int", "fault"]
    assert said["sampling_time"] == 1e-3
    assert said["state_bytes"] == 8 * (1 + 4)
    assert said["scenario"] == "damper"


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
    said = CController.of(Network.of(block), 1e-3, turning=turning).interface()
    assert (said["inputs"][0]["unit"], said["outputs"][0]["unit"]) == (joints, drives)


@needs_gcc
def test_c_is_python_to_the_last_bit(controller, tmp_path):
    controller.write(tmp_path)
    sources = [str(file) for file in tmp_path.glob("*.c")]
    library = tmp_path / "controller.so"
    subprocess.run(["gcc", *FLAGS, "-o", str(library), *sources, "-lm"], check=True)
    c = ctypes.CDLL(str(library))
    state = (ctypes.c_double * 5)()
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
