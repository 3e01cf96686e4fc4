"""What is required of parameters, as linear inequalities."""

from dataclasses import dataclass

import numpy as np

from identification.consistency.bounds import LinkBounds, PhysicalBounds
from identification.consistency.layout import Layout
from identification.consistency.pseudo_inertia import linear_terms
from identification.model.parameters import LINK_PARAMETERS, PER_LINK
from pfsc_drake.errors import InputError

_TERMS = np.array(linear_terms())
_MASS, _FIRST_MOMENT = (LINK_PARAMETERS.index(name) for name in ("m", "mx"))


@dataclass(frozen=True, eq=False)
class Intervals:
    """``lower <= G rho <= upper``, where ends may be infinite or equal.

    Attributes:
        G: Shape (k, n).
        lower: Shape (k,).
        upper: Shape (k,).
    """

    G: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def extended(link: LinkBounds) -> np.ndarray:
    """Return ``M_k``, shape (10, 4, 4), of the matrix ``sum_k rho_k M_k >= 0`` of a link.

    That is ``P - m r^2 diag(1, 1, 1, 0)``: about the centre of mass its first three rows and
    columns are positive semidefinite just if the mass spreads by r in every direction.

    Args:
        link: What is known of it, with the least extent r.
    """
    terms = _TERMS.copy()
    terms[_MASS, :3, :3] -= link.least_extent**2 * np.eye(3)
    return terms


def link_intervals(link: LinkBounds) -> Intervals:
    """Return what is known of the ten parameters of a link, k rows of shape (k, 10).

    The mass is within its bounds, ``m lower <= h <= m upper`` for the centre of mass, and
    ``int (x - lower)(upper - x) dm >= 0`` along each axis for all that is inside the body's box.

    Args:
        link: What is known.
    """
    unit = np.eye(PER_LINK)
    mass, moments = unit[_MASS], unit[_FIRST_MOMENT : _FIRST_MOMENT + 3]
    box = link.center_of_mass
    rows = [mass, *(moments - np.outer(box.lower, mass)), *(np.outer(box.upper, mass) - moments)]
    if link.body is not None:
        first, last = link.body.lower, link.body.upper
        second = np.diagonal(_TERMS, axis1=1, axis2=2)[:, :3].T
        inside = (first + last)[:, None] * moments - np.outer(first * last, mass) - second
        rows += [*inside]
    lower, upper = np.zeros(len(rows)), np.full(len(rows), np.inf)
    lower[0], upper[0] = link.mass
    return Intervals(np.array(rows), lower, upper)


def other_intervals(layout: Layout, bounds: PhysicalBounds) -> Intervals:
    """Return what is known beside the links one by one, rows of shape (k, n).

    Those are the total mass, rotors, friction, which is not negative, and the masses of a DELTA
    robot.

    Args:
        layout: Of the n parameters.
        bounds: What is known.
    """
    unit, none = np.eye(layout.size), [0.0, np.inf]
    rows = list(
        zip(unit[layout.rotors], bounds.rotor_inertia or [none] * layout.rotors.size, strict=True)
    )
    rows += [(unit[i], none) for i in layout.friction]
    if bounds.total_mass:
        rows.append((unit[layout.links[:, _MASS]].sum(axis=0), bounds.total_mass))
    if bounds.delta is not None:
        slides, delta = unit[layout.slides], bounds.delta
        rows += [(row, list(delta.slide)) for row in slides]
        rows.append((unit[layout.masses[-1]], list(delta.plate)))
        if delta.equal_slides:
            rows += [(row - slides[0], [0.0, 0.0]) for row in slides[1:]]
    ends = np.array([interval for _, interval in rows]).reshape(-1, 2)
    return Intervals(np.array([row for row, _ in rows]).reshape(-1, layout.size), *ends.T)


def check_bounds(layout: Layout, bounds: PhysicalBounds) -> None:
    """Refuse bounds of another robot.

    Raises:
        InputError: If they are not of as many links, or of a DELTA robot where there is none.
    """
    given = f"{len(bounds.links)} links" if bounds.delta is None else "a DELTA robot"
    there = "a DELTA robot" if layout.is_delta else f"{len(layout.links)} links"
    if given != there:
        raise InputError(f"bounds of {bounds.name}: {given}; must be {there}")
