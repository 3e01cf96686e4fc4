"""What parameters that the torques do not depend on tend to."""

from collections.abc import Sequence

import numpy as np

from identification.consistency.bounds import LinkBounds, PhysicalBounds
from identification.consistency.layout import Layout
from identification.consistency.pseudo_inertia import SIZE, from_pseudo_inertia, pseudo_inertia
from pfsc_drake.errors import InputError

# of the largest eigenvalue in units of mass and size; a flatter prior holds on too hard
_FLATTEST = 1e-9


def prior_from_bounds(names: Sequence[str], bounds: PhysicalBounds) -> np.ndarray:
    """Return a full set of parameters in the middle of what is known, shape (n,).

    Each link weighs the geometric mean of its bounds and fills the box of its centre of mass
    evenly; bounded rotors have the geometric mean of their bounds. Friction and rotors without
    bounds are NaN: nothing is assumed of them. Masses of a DELTA robot are identifiable, and NaN.

    Args:
        names: Of the n parameters.
        bounds: What is known.
    """
    layout = Layout.of(names)
    prior = np.full(layout.size, np.nan)
    for rows, link in zip(layout.links, bounds.links, strict=True):
        prior[rows] = _middle(link)
    for row, interval in zip(layout.rotors, bounds.rotor_inertia, strict=False):
        prior[row] = np.sqrt(np.prod(interval))
    return prior


def check_prior(names: Sequence[str], prior: np.ndarray) -> np.ndarray:
    """Return a prior, such as the robot's CAD data, shape (n,).

    Args:
        names: Of the n parameters.
        prior: Full set; NaN for what nothing is assumed of, which no link's parameter can be.

    Raises:
        InputError: If the shape differs, or a link is not the parameters of an extended body.
    """
    layout, prior = Layout.of(names), np.asarray(prior, dtype=float)
    if prior.shape != (layout.size,):
        raise InputError(f"prior: shape {prior.shape}; must be ({layout.size},)")
    for i, rows in enumerate(layout.links):
        if not np.all(np.isfinite(prior[rows])):
            raise InputError(f"prior: {layout.link_name(i)} has a parameter that is not finite")
        if not _is_extended(prior[rows]):
            raise InputError(
                f"prior: {layout.link_name(i)} of {prior[rows[0]]:g} kg has no positive definite "
                "pseudo-inertia; allowed: bodies that extend in all directions"
            )
    for row in layout.rotors:
        if prior[row] <= 0.0:
            raise InputError(f"prior: {layout.names[row]} = {prior[row]:g}; must be positive")
    return prior


def _middle(link: LinkBounds) -> np.ndarray:
    mass, center = np.sqrt(np.prod(link.mass)), link.center_of_mass.center
    variance = link.center_of_mass.half_widths**2 / 3.0 + link.least_extent**2
    P = np.empty((SIZE, SIZE))
    P[:3, :3] = np.diag(variance) + np.outer(center, center)
    P[:3, 3] = P[3, :3] = center
    P[3, 3] = 1.0
    return from_pseudo_inertia(mass * P)


def _is_extended(parameters: np.ndarray) -> bool:
    P = pseudo_inertia(parameters)
    if not np.all(np.diag(P) > 0.0):
        return False
    size = np.sqrt(np.trace(P[:3, :3]) / P[3, 3])
    units = np.sqrt(P[3, 3]) * np.array([size, size, size, 1.0])
    return bool(np.linalg.eigvalsh(P / np.outer(units, units))[0] > _FLATTEST)
