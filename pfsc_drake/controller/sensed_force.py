"""Measured force on the tool, from the reading of a sensor behind the tool."""

import numpy as np

from pfsc_drake.control.compliance.measured_wrench import PayloadCompensation
from pfsc_drake.control.compliance.tool_compensation import (
    ToolCompensation,
    ToolCompensationParameters,
)
from pfsc_drake.controller.extension import Extension, OpenController
from pfsc_drake.robot.tool_load import ToolLoad


class SensedForce(Extension):
    """Taring of a force/torque sensor, and compensation of the tool behind it.

    Ports:
        measured_wrench (input): Reading, axes of the sensor, shape (6,) [N, Nm].

    Args:
        load: Nominal load behind the sensor.
        measurement_range: Largest reading of each component, shape (6,) [N, Nm].
        parameters: Parameters of the compensation.
    """

    measures = True

    def __init__(
        self, load: ToolLoad, measurement_range: np.ndarray, parameters: ToolCompensationParameters
    ) -> None:
        self._load, self._range, self._parameters = load, measurement_range, parameters

    def before_law(self, assembly: OpenController) -> None:
        """Add the compensation."""
        robot, period = assembly.nominal.robot, assembly.period
        compensation = assembly.add(
            "tool_compensation",
            ToolCompensation(robot, self._load, self._range, self._parameters, period),
            measured_wrench=assembly.open("measured_wrench", 6),
            joint_state=assembly.signals["found_state"],
        )
        ports = {"wrench_measured": "wrench", "tared": "tared", "sensor_fault": "fault"}
        assembly.show(**{name: compensation.GetOutputPort(port) for name, port in ports.items()})


class Payload(Extension):
    """Compensation of a grasped payload behind a force/torque sensor.

    Ports:
        held (input): Grasped share, 0 to 1, shape (1,).

    Args:
        mass: Nominal mass [kg].
        p_TC: Centre of mass in the tool frame [m], shape (3,).
        gravity: World axes [m/s^2], shape (3,).
    """

    def __init__(self, mass: float, p_TC: np.ndarray, gravity: np.ndarray) -> None:
        self._block = PayloadCompensation(mass, p_TC, gravity)

    def before_law(self, assembly: OpenController) -> None:
        """Add the compensation."""
        signals = assembly.signals
        system = assembly.add(
            "payload_compensation",
            self._block,
            wrench=signals["wrench_measured"],
            tool_pose=signals["tool_pose"],
            held=assembly.open("held", 1),
            tared=signals["tared"],
            sensor_fault=signals["sensor_fault"],
        )
        assembly.show(
            wrench_measured=system.GetOutputPort("payload_free"),
            sensor_fault=system.GetOutputPort("fault"),
        )
