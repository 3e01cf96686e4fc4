"""Messages against Drake's own senders and receivers."""

import numpy as np
import pytest
from drake import lcmt_iiwa_command, lcmt_iiwa_status, lcmt_panda_command, lcmt_panda_status
from pydrake.lcm import DrakeLcm
from pydrake.manipulation import (
    IiwaCommandReceiver,
    IiwaControlMode,
    IiwaStatusReceiver,
    PandaCommandReceiver,
    PandaStatusReceiver,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.lcm import LcmSubscriberSystem

from pfsc_drake.drivers.driver_rules import check_mode
from pfsc_drake.drivers.messages import (
    ControlMode,
    RobotCommand,
    RobotMode,
    RobotStatus,
    decode_wrench,
    dialect,
    encode_wrench,
)
from pfsc_drake.errors import InputError

RANDOM = np.random.default_rng(0)
Q, V, TAU = RANDOM.normal(size=(3, 7))
STATUS = RobotStatus(123_456, Q, V, TAU, RobotMode.MOVE, ControlMode.TORQUE)


def read(system, kind, data, *ports):
    """Return what a Drake system makes of bytes that come over a bus."""
    lcm, builder = DrakeLcm("memq://"), DiagramBuilder()
    subscriber = LcmSubscriberSystem.Make("TOLD", kind, lcm, use_cpp_serializer=True)
    builder.AddSystem(subscriber)
    builder.AddSystem(system)
    builder.Connect(subscriber.get_output_port(), system.get_input_port(0))
    simulator = Simulator(builder.Build())
    context = system.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for name in ("position_measured",) if system.num_input_ports() > 1 else ():
        system.GetInputPort(name).FixValue(context, np.zeros(7))
    lcm.Publish("TOLD", data)
    lcm.HandleSubscriptions(0)
    simulator.AdvanceTo(0.01)
    return [system.GetOutputPort(port).Eval(context) for port in ports]


def test_drake_reads_the_status_of_a_panda():
    data = dialect("panda").encode_status(STATUS)
    ports = "position_measured", "velocity_measured", "torque_measured"
    found = read(PandaStatusReceiver(7), lcmt_panda_status, data, *ports)
    np.testing.assert_array_equal(found, [Q, V, TAU])
    assert lcmt_panda_status.decode(data).robot_mode == 2


def test_drake_reads_the_status_of_an_iiwa_whose_torques_have_the_other_sign():
    data = dialect("iiwa").encode_status(STATUS)
    ports = "position_measured", "velocity_estimated", "torque_measured"
    found = read(IiwaStatusReceiver(7), lcmt_iiwa_status, data, *ports)
    np.testing.assert_array_equal(found, [Q, V, -TAU])


@pytest.mark.parametrize(
    ("mode", "port"),
    [
        (ControlMode.TORQUE, "torque"),
        (ControlMode.VELOCITY, "velocity"),
        (ControlMode.POSITION, "position"),
    ],
)
def test_drake_reads_commands_to_a_panda(mode, port):
    command = RobotCommand(7, mode, TAU)
    data = dialect("panda").encode_command(command)
    (found,) = read(PandaCommandReceiver(7, int(mode)), lcmt_panda_command, data, port)
    np.testing.assert_array_equal(found, TAU)
    message = lcmt_panda_command.decode(data)
    assert message.control_mode_expected == int(mode)
    assert message.utime == 7


def test_drake_reads_commands_to_an_iiwa():
    command = RobotCommand(7, ControlMode.TORQUE, TAU)
    data = dialect("iiwa").encode_command(command)
    system = IiwaCommandReceiver(7, IiwaControlMode.kTorqueOnly)
    (found,) = read(system, lcmt_iiwa_command, data, "torque")
    np.testing.assert_array_equal(found, TAU)


@pytest.mark.parametrize("name", ["panda", "iiwa"])
def test_messages_are_read_as_they_were_written(name):
    spoken = dialect(name)
    status = spoken.decode_status(spoken.encode_status(STATUS))
    for attribute in ("q", "v", "torque"):
        np.testing.assert_array_equal(getattr(status, attribute), getattr(STATUS, attribute))
    assert (status.utime, status.robot_mode) == (STATUS.utime, STATUS.robot_mode)
    command = spoken.decode_command(spoken.encode_command(RobotCommand(5, ControlMode.TORQUE, TAU)))
    assert (command.utime, command.mode) == (5, ControlMode.TORQUE)
    np.testing.assert_array_equal(command.values, TAU)


@pytest.mark.parametrize(
    ("name", "channels", "expiry"),
    [
        ("panda", ("PANDA_STATUS", "PANDA_COMMAND"), 0.1),
        ("iiwa", ("IIWA_STATUS", "IIWA_COMMAND"), 0.05),
    ],
)
def test_what_drivers_listen_to_and_for_how_long(name, channels, expiry):
    spoken = dialect(name)
    assert (spoken.status_channel, spoken.command_channel) == channels
    assert spoken.expiry == expiry


def test_wrenches():
    wrench = RANDOM.normal(size=6)
    np.testing.assert_array_equal(decode_wrench(encode_wrench(3, wrench)), wrench)


def test_what_is_no_message():
    for name in ("panda", "iiwa"):
        with pytest.raises(ValueError, match="Decode error"):
            dialect(name).decode_status(b"nothing of the kind")
        with pytest.raises(ValueError, match="Decode error"):
            dialect(name).decode_command(b"nothing of the kind")


def test_names_and_modes_that_there_are_not():
    with pytest.raises(InputError, match="driver ur5: allowed: panda, iiwa"):
        dialect("ur5")
    with pytest.raises(InputError, match="driver iiwa: takes no VELOCITY; allowed: TORQUE"):
        check_mode(ControlMode.VELOCITY, dialect("iiwa").modes, "iiwa")
    check_mode(ControlMode.VELOCITY, dialect("panda").modes, "panda")
