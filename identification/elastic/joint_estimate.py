"""What was found of an elastic joint."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError

_VAGUE = 0.2  # relative standard deviation of a stiffness that tells nothing
_SURE = 4.0  # standard deviations


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """What was found of one joint, on the joint side; units of a slide in brackets.

    Attributes:
        name: Of the joint.
        unit: ``rad`` or ``m``.
        locked: Whether the link was.
        values: Of ``parameters``, shape (n,).
        covariance: Of ``values``, shape (n, n).
        parameters: Which were estimated: ``stiffness`` [Nm/rad (N/m)], ``damping``
            [Nm s/rad (N s/m)], ``inertia`` of the motor [kg m^2 (kg)], ``coulomb`` [Nm (N)],
            ``lag`` l [Nm s (N s)] where the motor reverses often, ``viscous`` [Nm s/rad (N s/m)]
            unless locked, ``offset`` [Nm (N)]. For a locked joint ``damping`` has lost the
            viscous friction that was given.
        residual: RMS of what the equation leaves over of the torque, smoothed [Nm or N].
        samples: That were used.
    """

    name: str
    unit: str
    locked: bool
    values: np.ndarray
    covariance: np.ndarray
    parameters: tuple[str, ...]
    residual: float
    samples: int

    def value(self, parameter: str) -> float:
        """Return the value of a parameter."""
        return float(self.values[self.parameters.index(parameter)])

    def deviation(self, parameter: str) -> float:
        """Return the standard deviation of a parameter."""
        i = self.parameters.index(parameter)
        return float(np.sqrt(self.covariance[i, i]))

    @property
    def stiffness(self) -> float:
        """``K_s``."""
        return self.value("stiffness")

    @property
    def damping(self) -> float:
        """``K_d``."""
        return self.value("damping")

    @property
    def inertia(self) -> float:
        """Entry of ``D_M``."""
        return self.value("inertia")

    @property
    def resonance(self) -> float:
        """Of the motor against a held link [Hz]."""
        return float(np.sqrt(self.stiffness / self.inertia) / (2.0 * np.pi))


def check_estimate(where: str, estimate: JointEstimate) -> None:
    """Refuse what no joint has, or what says next to nothing.

    Args:
        where: Of the joint, for messages.
        estimate: Of the joint.

    Raises:
        InputError: If the stiffness is vague, or a parameter is certainly negative.
    """
    value, deviation = estimate.stiffness, estimate.deviation("stiffness")
    if not deviation < _VAGUE * abs(value):
        raise InputError(
            f"{where}: not excited as an elastic joint: stiffness {value:.3g} with a standard "
            f"deviation of {deviation:.3g}; must be below {_VAGUE:g} of it, torques that twist the "
            "joint more are required"
        )
    for name in ("stiffness", "inertia", "viscous", "damping"):
        if name not in estimate.parameters:
            continue
        value, deviation = estimate.value(name), estimate.deviation(name)
        if value < -_SURE * deviation:
            hint = "sign of the torque?" if name == "stiffness" else "signals at other instants?"
            raise InputError(
                f"{where}: {name} = {value:.4g} (standard deviation {deviation:.2g}); must not be "
                f"negative ({hint})"
            )
