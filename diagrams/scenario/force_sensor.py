"""The force/torque sensor of a scenario's robot."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import require, require_not_negative
from pfsc_drake.control.compliance.taring import STILL_TIME
from pfsc_drake.control.compliance.tool_compensation import ToolCompensationParameters
from pfsc_drake.physics.force_torque_sensor import ForceTorqueParameters


@dc.dataclass
class SensorParameters:
    """The force/torque sensor and how its signal is used; only built with compliance.

    In arrays of six, the first three entries are forces [N], the others torques [Nm].

    Attributes:
        joint: Fixed joint of the model with the sensor in it; its child side is the tool. By
            default, of those between the last moving link and the tool frame, the nearest to the
            tool that has mass behind it.
        measurement_range: Largest magnitude that is measured, shape (6,).
        bias: Reading without load, shape (6,).
        noise: Standard deviation of one sample, shape (6,). A sensor that has some and repeats
            itself to the last bit is lost; 0 where its steps are larger than that.
        bandwidth: Of the sensor's filter, and of the tool compensation's [Hz].
        delay: Until the controller has what is measured [s], a multiple of its sampling time,
            shorter than taring and than what a sensor may stand still.
        seed: Of the noise.
        inertia: ``differentiated`` or ``none``: whether the tool's inertia is taken off.
        unknown_mass: What may hang below the sensor beside what is believed [kg]: for what is
            said before a run alone, see
            :func:`~diagrams.tasks.sensed_load.sensed_load_warnings`, and for margins.
        taring_time: Length of the quiet stretch whose mean becomes the bias [s].
        taring_spread: Largest difference of means over 10 ms within it, shape (6,).
        taring_bias: Largest bias that is believed, shape (6,).
        force_dead_band: [N].
        torque_dead_band: [Nm].
    """

    joint: str = ""
    measurement_range: np.ndarray = dc.field(
        default_factory=lambda: ForceTorqueParameters().measurement_range
    )
    bias: np.ndarray = dc.field(default_factory=lambda: ForceTorqueParameters().bias)
    noise: np.ndarray = dc.field(default_factory=lambda: ForceTorqueParameters().noise)
    bandwidth: float = 200.0
    delay: float = 0.0
    seed: int = 0
    inertia: str = "differentiated"
    unknown_mass: float = 0.0
    taring_time: float = 0.05
    taring_spread: np.ndarray = dc.field(
        default_factory=lambda: ToolCompensationParameters().taring_spread
    )
    taring_bias: np.ndarray = dc.field(
        default_factory=lambda: ToolCompensationParameters().taring_bias
    )
    force_dead_band: float = 0.0
    torque_dead_band: float = 0.0

    def __post_init__(self) -> None:
        # accelerations are known to no component of the station
        known = self.inertia in ("differentiated", "none")
        require(known, "inertia", self.inertia, "differentiated, none")
        require_not_negative("unknown_mass", self.unknown_mass)
        self.transducer()
        self.compensation()
        # until something comes there is nothing to tare, and a sensor that says nothing is lost
        longest = min(STILL_TIME, self.taring_time)
        allowed = f"at least 0 and below {longest:g} s"
        require(0.0 <= self.delay < longest, "delay", self.delay, allowed)

    def transducer(self) -> ForceTorqueParameters:
        """Return the properties of the sensor itself."""
        return ForceTorqueParameters(
            measurement_range=self.measurement_range,
            bias=self.bias,
            noise=self.noise,
            bandwidth=self.bandwidth,
            seed=self.seed,
        )

    def compensation(self) -> ToolCompensationParameters:
        """Return how the tool's load is taken off."""
        return ToolCompensationParameters(
            inertia=self.inertia,
            bandwidth=self.bandwidth,
            taring_time=self.taring_time,
            taring_spread=self.taring_spread,
            taring_bias=self.taring_bias,
            force_dead_band=self.force_dead_band,
            torque_dead_band=self.torque_dead_band,
            noise=self.noise,
        )
