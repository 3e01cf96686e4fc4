"""Pseudo-inertia matrices: conditions for ten numbers to be the inertial parameters of a body.

For a body with density ``rho`` and points ``p`` in the link frame::

    P = int [p; 1] [p; 1]' rho dV = [Sigma  h]      Sigma = tr(I) / 2 E - I,  h = m p_LC
                                    [h'     m]

is linear in the ten parameters of a link. They belong to a distribution of positive mass if and
only
if P is positive semidefinite: then the mass is positive, and the principal moments of inertia about
the centre of mass are positive and satisfy the triangle inequalities (P. M. Wensing, S. Kim,
J.-J. E. Slotine: Linear matrix inequalities for physically consistent inertial parameter
identification. IEEE Robotics and Automation Letters 3(1), 2018).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.model.dynamic_parameters import (
    LINK_PARAMETERS,
    PER_LINK,
    from_moments,
    link_moments,
)
from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_parameters import NUM_ARMS

SIZE = 4


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Return P, shape (4, 4): second moments [kg m^2], first moments [kg m] and mass [kg].

    Args:
        parameters: The ten parameters of a link about the origin of its frame, shape (10,).
    """
    mass, moment, inertia = link_moments(parameters)
    P = np.empty((SIZE, SIZE))
    P[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    P[:3, 3] = P[3, :3] = moment
    P[3, 3] = mass
    return P


def from_pseudo_inertia(P: np.ndarray) -> np.ndarray:
    """Return the ten parameters of a link, shape (10,); the inverse of :func:`pseudo_inertia`.

    Args:
        P: Symmetric, shape (4, 4).
    """
    second = P[:3, :3]
    return from_moments(float(P[3, 3]), P[:3, 3], np.trace(second) * np.eye(3) - second)


def linear_terms() -> list[np.ndarray]:
    """Return the ten matrices ``P_k`` of ``P = sum_k rho_k P_k``, each of shape (4, 4)."""
    return [pseudo_inertia(unit) for unit in np.eye(PER_LINK)]


def spread(parameters: np.ndarray) -> np.ndarray:
    """Return the extent of a link's mass along its principal axes [m], shape (3,).

    It is the standard deviation of the mass distribution, ascending; NaN if its square is negative,
    which a consistent set excludes.

    Args:
        parameters: The ten parameters of a link with a positive mass, shape (10,).
    """
    P = pseudo_inertia(parameters)
    about_center = P[:3, :3] / P[3, 3] - np.outer(P[:3, 3], P[:3, 3]) / P[3, 3] ** 2
    squares = np.linalg.eigvalsh(about_center)
    return np.sqrt(squares, out=np.full(3, np.nan), where=squares >= 0.0)


def distance(P: np.ndarray, prior: np.ndarray) -> float:
    """Return the distance of a link from another, ``|L^-1 (P - P_0) L^-T|^2 / 2``, ``P_0 = L L'``.

    It is the relative entropy of the two distributions of mass up to second order, independent of
    the frame and the units, and convex in P (T. Lee, P. M. Wensing, F. C. Park: Geometric robot
    dynamic identification: a convex programming approach. IEEE Transactions on Robotics 36(2),
    2020).

    Args:
        P: Shape (4, 4).
        prior: ``P_0``, positive definite, shape (4, 4).
    """
    ratio = np.linalg.solve(prior, P - prior)
    return float(0.5 * np.trace(ratio @ ratio))


@dataclass(frozen=True, eq=False)
class Layout:
    """Indices of the parameters of a robot with N joints.

    Attributes:
        names: Names of the n parameters, see
            :func:`~identification.model.dynamic_parameters.parameter_names`.
        links: Ten indices of each link, shape (N, 10); (0, 10) for a DELTA robot.
        rotors: Indices of the rotor inertias, shape (N,); empty for a DELTA robot.
        masses: Indices of the slides' masses and the plate's of a DELTA robot, shape (4,); else
            empty.
        friction: Indices of the friction, shape (2 N,) or empty.
    """

    names: list[str]
    links: np.ndarray
    rotors: np.ndarray
    masses: np.ndarray
    friction: np.ndarray

    @classmethod
    def of(cls, names: Sequence[str]) -> "Layout":
        """Return the layout of parameters by their names.

        Args:
            names: All parameters of a robot, in their order.
        """
        kinds = np.array([name.split(".")[1] for name in names])
        is_link = np.isin(kinds, LINK_PARAMETERS)
        return cls(
            list(names),
            np.flatnonzero(is_link).reshape(-1, PER_LINK),
            np.flatnonzero(kinds == "I_M"),
            np.flatnonzero(np.isin(kinds, ["m_q", "m_y"])),
            np.flatnonzero(np.isin(kinds, ["f_c", "f_v"])),
        )

    @property
    def size(self) -> int:
        """Number of parameters n."""
        return len(self.names)

    @property
    def is_delta(self) -> bool:
        """Whether they belong to a DELTA robot."""
        return self.masses.size > 0

    @property
    def slides(self) -> np.ndarray:
        """Indices of the slides' masses of a DELTA robot, shape (3,)."""
        return self.masses[:NUM_ARMS]

    def link_name(self, link: int) -> str:
        """Return the name of a link, counted from 0: ``link_1``."""
        return self.names[self.links[link, 0]].split(".")[0]

    def check(self, key: str, values: np.ndarray) -> np.ndarray:
        """Return parameters as an array, shape (n,).

        Args:
            key: Name of the parameters, for the message.
            values: One number per parameter.

        Raises:
            InputError: If their number is wrong, or one is not finite.
        """
        values = np.asarray(values, dtype=float)
        if values.shape != (self.size,):
            raise InputError(f"{key}: shape {values.shape}; must be ({self.size},)")
        if not np.all(np.isfinite(values)):
            first = int(np.argmin(np.isfinite(values)))
            raise InputError(f"{key}: {self.names[first]} = {values[first]}; must be finite")
        return values
