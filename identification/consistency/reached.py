"""Which bounds hold a consistent set where it is."""

from collections.abc import Iterator, Sequence

import numpy as np

from identification.consistency.bounds import LinkBounds, PhysicalBounds
from identification.consistency.constraints import check_bounds
from identification.consistency.layout import Layout
from identification.consistency.pseudo_inertia import spread

# of the distance between two bounds, or of the bound itself, at which it counts as reached
_CLOSE = 1e-3


def reached_bounds(
    names: Sequence[str], parameters: np.ndarray, bounds: PhysicalBounds
) -> list[str]:
    """Return the bounds that parameters have reached, one sentence each.

    Of such parameters the measurement, or the prior, wants more than the bounds allow: either they
    are too narrow, or something is not modelled.

    Args:
        names: Of the n parameters.
        parameters: All of them, shape (n,).
        bounds: What they keep.

    Raises:
        InputError: If the bounds are of another robot, there are not as many parameters, or one is
            not finite.
    """
    layout = Layout.of(names)
    check_bounds(layout, bounds)
    parameters = layout.check("parameters", parameters)
    found = []
    for i, (rows, link) in enumerate(zip(layout.links, bounds.links, strict=True)):
        found += [f"{layout.link_name(i)}: {what}" for what in _of_link(parameters[rows], link)]
    intervals: list[tuple[int, Sequence[float] | np.ndarray]] = []
    if bounds.rotor_inertia:
        intervals += zip(layout.rotors.tolist(), bounds.rotor_inertia, strict=True)
    if bounds.delta is not None:
        intervals += [(row, bounds.delta.slide) for row in layout.slides.tolist()]
        intervals.append((int(layout.masses[-1]), bounds.delta.plate))
    for row, (least, largest) in intervals:
        side = _side(parameters[row], least, largest)
        if side:
            found.append(f"{layout.names[row]} is as {side} as allowed, {parameters[row]:.4g}")
    found += [f"{layout.names[row]} is zero" for row in layout.friction if parameters[row] <= 0.0]
    return found


def _of_link(parameters: np.ndarray, link: LinkBounds) -> Iterator[str]:
    mass, box = parameters[0], link.center_of_mass
    side = _side(mass, *link.mass)
    if side:
        yield f"mass is as {side} as allowed, {mass:.4g} kg"
    for axis, place, least, largest in zip(
        "xyz", parameters[1:4] / mass, box.lower, box.upper, strict=True
    ):
        if _side(place, least, largest):
            yield f"centre of mass is at the end of its box along {axis}, {place:.4g} m"
    if spread(parameters)[0] <= (1.0 + _CLOSE) * link.least_extent:
        thin = np.count_nonzero(spread(parameters) <= (1.0 + _CLOSE) * link.least_extent)
        where = ("in one direction", "in two directions", "in all directions")[thin - 1]
        yield f"mass spreads as little as allowed {where}, {link.least_extent:.4g} m"


def _side(value: float, least: float, largest: float) -> str:
    """Return at which end of an interval a value is, if at one; none of those without width."""
    width = _CLOSE * (largest - least)
    if width <= 0.0:
        return ""
    if value <= least + width:
        return "small"
    return "large" if value >= largest - width else ""
