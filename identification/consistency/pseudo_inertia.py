"""Pseudo-inertia matrices: when ten numbers are the inertial parameters of a body.

For a body with density ``rho`` and points ``p`` in the link frame::

    P = int [p; 1] [p; 1]' rho dV = [Sigma  h]      Sigma = tr(I) / 2 E - I,  h = m p_LC
                                    [h'     m]

is linear in the ten parameters of a link. They belong to some distribution of positive mass if and
only if P is positive semidefinite: then the mass is positive, and the principal moments of inertia
about the centre of mass are positive and obey the triangle inequalities (P. M. Wensing, S. Kim,
J.-J. E. Slotine: Linear matrix inequalities for physically consistent inertial parameter
identification. IEEE Robotics and Automation Letters 3(1), 2018).
"""

import numpy as np

from identification.model.parameters import PER_LINK, from_moments, link_moments

SIZE = 4


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Return P, shape (4, 4): second moments [kg m^2], first moments [kg m] and mass [kg].

    Args:
        parameters: The ten of one link about the origin of its frame, shape (10,).
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
    """Return how far the mass of a link spreads along its principal axes [m], shape (3,).

    That is the standard deviation of the places of its mass, ascending; NaN where its square is
    negative, of which there is none in a consistent set.

    Args:
        parameters: The ten of one link, with a positive mass, shape (10,).
    """
    P = pseudo_inertia(parameters)
    about_center = P[:3, :3] / P[3, 3] - np.outer(P[:3, 3], P[:3, 3]) / P[3, 3] ** 2
    squares = np.linalg.eigvalsh(about_center)
    return np.sqrt(squares, out=np.full(3, np.nan), where=squares >= 0.0)


def distance(P: np.ndarray, prior: np.ndarray) -> float:
    """Return how far a link is from another, ``|L^-1 (P - P_0) L^-T|^2 / 2`` with ``P_0 = L L'``.

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
