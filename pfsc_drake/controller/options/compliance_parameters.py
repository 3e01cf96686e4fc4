"""Compliance of a tool with forces, and observation of forces without a sensor."""

import dataclasses as dc
from typing import Annotated

import numpy as np

from pfsc_drake.checks import require, require_between
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    SlowEnds,
)
from pfsc_drake.control.compliance.pressing import PressParameters
from pfsc_drake.control.fixtures.fixture_parameters import RobotLimitParameters
from pfsc_drake.yaml.rules import NotNegative, OneOf, Parameters, Positive

SOURCES = ("sensor", "observed")
# limits of an impedance: least and most mass, most damping, most stiffness, and their units
_TRANSLATION = (1e-3, 1e4, 1e7, 1e9, "kg", "N s/m", "N/m")
_ROTATION = (1e-6, 1e4, 1e6, 1e8, "kg m^2", "Nm s/rad", "Nm/rad")
_BOUNDS = {"tangential": _TRANSLATION, "transversal": _TRANSLATION, "rotational": _ROTATION}


@dc.dataclass
class ObservedForceParameters(Parameters):
    """Forces on the tool from the torques in the joints, without a sensor.

    Attributes:
        rate: Rate of the observer [1/s].
        damping: Damping of the inverse of the Jacobian in singular postures.
        force_dead_band: Dead band of forces [N], for the effects of friction and model errors.
        torque_dead_band: Dead band of torques [Nm].
    """

    rate: Positive = 100.0
    damping: NotNegative = 0.02
    force_dead_band: NotNegative = 0.0
    torque_dead_band: NotNegative = 0.0


@dc.dataclass
class ComplianceParameters(Parameters):
    """Compliance of the tool with measured forces (3.42), (3.44); rigid by default.

    Attributes:
        source: Source of the forces: the ``sensor``, or ``observed`` from the joint motion, for
            backdrivable robots.
        observed: Observer of the forces.
        tangential: Impedance of eta.
        transversal: Impedance of xi_1 and xi_2.
        rotational: Impedance of the angles, three or those of the tool's axis; oriented paths
            only.
        with_turning: Whether torques act along eta if the path's orientation turns.
        press: Force reference normal to a surface, whose transversal coordinate then has no
            stiffness. None without the block.
        limits: Limits of the robot for hand guiding along a path or a surface; in space see
            ``fixtures.limits``.
    """

    source: Annotated[str, OneOf(SOURCES)] = "sensor"
    observed: ObservedForceParameters = dc.field(default_factory=ObservedForceParameters)
    tangential: CoordinateImpedance = dc.field(default_factory=CoordinateImpedance)
    transversal: CoordinateImpedance = dc.field(default_factory=CoordinateImpedance)
    rotational: CoordinateImpedance = dc.field(default_factory=CoordinateImpedance)
    with_turning: bool = False
    press: PressParameters | None = None
    limits: RobotLimitParameters = dc.field(default_factory=RobotLimitParameters)

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind, bounds in _BOUNDS.items():
            _require_feasible(kind, getattr(self, kind), *bounds)
        stiffness = self.transversal.stiffness
        free = not stiffness.at and stiffness.value == 0.0
        allowed = "null unless transversal.stiffness.value is 0, as the force reference requires"
        require(self.press is None or free, "press", "given", allowed)

    @property
    def needs_sensor(self) -> bool:
        """Whether any coordinate complies with measured forces."""
        return self.is_given and self.source == "sensor"

    @property
    def is_given(self) -> bool:
        """Whether any coordinate complies."""
        kinds = (self.tangential, self.transversal, self.rotational)
        return any(kind.stiffness.at or np.isfinite(kind.stiffness.value) for kind in kinds)

    def impedance(self) -> ImpedanceParameters:
        """Return the impedance of all coordinates."""
        return ImpedanceParameters(self.tangential, self.transversal, self.rotational)


def _require_feasible(
    kind: str,
    impedance: CoordinateImpedance,
    lightest: float,
    heaviest: float,
    most_damped: float,
    stiffest: float,
    *units: str,
) -> None:
    """Refuse values far from a feasible impedance; infinite stiffness is allowed."""
    for number in impedance.mass.values or [impedance.mass.value]:
        require_between(f"{kind}.mass", number, lightest, heaviest, units[0])
    damping = impedance.damping
    if isinstance(damping, SlowEnds):
        dampings = [damping.most]
    else:
        dampings = damping.values or [damping.value]
    for number in dampings:
        require_between(f"{kind}.damping", number, 0.0, most_damped, units[1])
    for number in impedance.stiffness.values or [impedance.stiffness.value]:
        good = number <= stiffest or number == np.inf
        allowed = f"0 to {stiffest:g} {units[2]}, or .inf for position control"
        require(good, f"{kind}.stiffness", number, allowed)
