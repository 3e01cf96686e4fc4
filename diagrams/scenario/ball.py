"""Balls with a soft shell on a tool."""

import dataclasses as dc

import numpy as np
from scipy.optimize import brentq

from diagrams.scenario.checks import require, require_between

SMALLEST, LARGEST = 1e-4, 10.0  # m, of workpiece and ball
_MODULUS = 1e3, 1e12  # Pa: softer than any foam, harder than any stone
STEPS = (1e-5, 1e-3)  # s, of a plant with contact


@dc.dataclass
class SoftBall:
    """A ball with a soft shell.

    Attributes:
        radius: Radius, 1e-4 to 10 [m].
        modulus: Elasticity of the shell, pressure per relative depth [Pa].
        dissipation: Of Hunt and Crossley [s/m].
        friction: Coulomb coefficient between ball and workpiece.
        resolution: Edge length of the mesh that contact is computed with, 1e-4 m or more.
    """

    radius: float = 0.02
    modulus: float = 1e6
    dissipation: float = 1.0
    friction: float = 0.2
    resolution: float = 6e-3

    def __post_init__(self) -> None:
        for key in ("radius", "resolution"):
            require_between(key, getattr(self, key), SMALLEST, LARGEST, "m, a positive number")
        require_between("modulus", self.modulus, *_MODULUS, "Pa; 4 MPa are 4e+06")
        for key, most in {"dissipation": 1e6, "friction": 1e3}.items():
            require_up_to(key, getattr(self, key), most)

    def stiffness(self, force: float) -> float:
        """Return by how much the force on a flat rigid body grows with the depth [N/m].

        The pressure in the ball grows with the depth, from zero at its skin to the modulus E in
        its centre. A flat at depth d bears ``F = pi E d^2 (1 - 2 d / (3 R))``, the pressure's
        integral over the disc that is touched, so that ``dF / dd = 2 pi E d (1 - d / R)``.

        Args:
            force: That it bears there [N].
        """
        R, E = self.radius, self.modulus

        def missing(d: float) -> float:
            return float(np.pi * E * d**2 * (1.0 - 2.0 * d / (3.0 * R)) - force)

        # from half of the way on the slope falls again: the steepest is on the safe side
        deepest = R / 2.0
        d = deepest if missing(deepest) <= 0.0 else float(brentq(missing, 0.0, deepest))
        return float(2.0 * np.pi * E * d * (1.0 - d / R))


def require_up_to(key: str, value: float, most: float) -> None:
    """Refuse what is negative or too large.

    Args:
        key: Name, for the message.
        value: What was given.
        most: Largest number that is allowed.

    Raises:
        InputError: If so.
    """
    require(0.0 <= value <= most, key, value, f"zero or a positive number, at most {most:g}")


def require_contact_step(time_step: float) -> None:
    """Refuse the step of a plant with contact [s].

    Raises:
        InputError: If contact cannot be computed with it.
    """
    shortest, longest = STEPS
    allowed = f"{shortest:g} to {longest:g} s"
    require(shortest <= time_step <= longest, "time_step", time_step, allowed)
