"""Compliance of a scenario's robot, and the force/torque sensor that it needs."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import (
    require,
    require_between,
    require_not_negative,
)
from pfsc_drake.control.compliance.impedance import CoordinateImpedance, ImpedanceParameters
from pfsc_drake.control.compliance.press import PressParameters
from pfsc_drake.control.compliance.slow_ends import SlowEnds
from pfsc_drake.control.compliance.still_components import STILL_TIME
from pfsc_drake.control.compliance.tool_compensation import ToolCompensationParameters
from pfsc_drake.control.fixtures.parameters import RobotLimitParameters
from pfsc_drake.following.options.compliance import ObservedForceParameters
from pfsc_drake.physics.force_torque_sensor import ForceTorqueParameters

SOURCES = ("sensor", "observed")
# of what a hand feels: least and most mass, most damping, most stiffness, and their units
_OF_PLACES = (1e-3, 1e4, 1e7, 1e9, "kg", "N s/m", "N/m")
_OF_ANGLES = (1e-6, 1e4, 1e6, 1e8, "kg m^2", "Nm s/rad", "Nm/rad")
_BOUNDS = {"tangential": _OF_PLACES, "transversal": _OF_PLACES, "rotational": _OF_ANGLES}


@dc.dataclass
class ComplianceParameters:
    """How the tool yields to measured forces (3.42), (3.44); what is not given stays rigid.

    Attributes:
        source: Where the forces come from: the ``sensor``, or ``observed`` from how the joints
            move, for robots that can be moved at their links.
        observed: How they are observed.
        tangential: Of eta.
        transversal: Of xi_1 and xi_2.
        rotational: Of the angles, three or those of the tool's axis; oriented paths only.
        with_turning: Whether torques act along eta where the path's orientation turns.
        press: With which force a tool presses on a surface, whose transversal coordinate has no
            stiffness then. None without the block.
        limits: How far the tool follows a hand along a path or a surface, to where the robot
            itself cannot go on; in space see ``fixtures.limits``.
    """

    source: str = "sensor"
    observed: ObservedForceParameters = dc.field(default_factory=ObservedForceParameters)
    tangential: CoordinateImpedance = dc.field(default_factory=CoordinateImpedance)
    transversal: CoordinateImpedance = dc.field(default_factory=CoordinateImpedance)
    rotational: CoordinateImpedance = dc.field(default_factory=CoordinateImpedance)
    with_turning: bool = False
    press: PressParameters | None = None
    limits: RobotLimitParameters = dc.field(default_factory=RobotLimitParameters)

    def __post_init__(self) -> None:
        require(self.source in SOURCES, "source", self.source, ", ".join(SOURCES))
        for kind, bounds in _BOUNDS.items():
            _require_bearable(kind, getattr(self, kind), *bounds)
        stiffness = self.transversal.stiffness
        free = not stiffness.at and stiffness.value == 0.0
        allowed = "null unless transversal.stiffness.value is 0, which lets the force decide"
        require(self.press is None or free, "press", "given", allowed)

    @property
    def needs_sensor(self) -> bool:
        """Whether anything yields to what a sensor measures."""
        return self.is_given and self.source == "sensor"

    @property
    def is_given(self) -> bool:
        """Whether any coordinate yields."""
        kinds = (self.tangential, self.transversal, self.rotational)
        return any(kind.stiffness.at or np.isfinite(kind.stiffness.value) for kind in kinds)

    def impedance(self) -> ImpedanceParameters:
        """Return the impedance of all coordinates."""
        return ImpedanceParameters(self.tangential, self.transversal, self.rotational)


def _require_bearable(
    kind: str,
    said: CoordinateImpedance,
    lightest: float,
    heaviest: float,
    most_damped: float,
    stiffest: float,
    *units: str,
) -> None:
    """Refuse numbers that are far from all that a hand feels; infinite stiffness is allowed."""
    for number in said.mass.values or [said.mass.value]:
        require_between(f"{kind}.mass", number, lightest, heaviest, units[0])
    damping = said.damping
    if isinstance(damping, SlowEnds):
        dampings = [damping.most]
    else:
        dampings = damping.values or [damping.value]
    for number in dampings:
        require_between(f"{kind}.damping", number, 0.0, most_damped, units[1])
    for number in said.stiffness.values or [said.stiffness.value]:
        good = number <= stiffest or number == np.inf
        allowed = f"0 to {stiffest:g} {units[2]}, or .inf for position control"
        require(good, f"{kind}.stiffness", number, allowed)


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
