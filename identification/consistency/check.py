"""Whether parameters are those of a robot, and what is wrong if not."""

import numpy as np

from identification.consistency.layout import Layout
from identification.consistency.pseudo_inertia import pseudo_inertia
from identification.model.parameters import link_moments, parameter_names
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

# of the largest moment of inertia, by which rounding may break an inequality
_ROUNDING = 1e-9


def inconsistencies(subject: Subject, parameters: np.ndarray) -> list[str]:
    """Return what no body has, one sentence each; nothing for a consistent set.

    Args:
        subject: The robot.
        parameters: All of them, with or without friction, shape (n,).

    Raises:
        InputError: If they are not as many, or one is not finite.
    """
    layout = layout_of(subject, parameters)
    parameters = layout.check("parameters", parameters)
    found = []
    for i, rows in enumerate(layout.links):
        found += [f"{layout.link_name(i)}: {reason}" for reason in link_faults(parameters[rows])]
    for rows, what in ((layout.rotors, "rotor inertia"), (layout.friction, "friction")):
        found += [
            f"{layout.names[row]} = {parameters[row]:.6g}: negative {what}"
            for row in rows
            if parameters[row] < 0.0
        ]
    found += [
        f"{layout.names[row]} = {parameters[row]:.6g} kg: must be positive"
        for row in layout.masses
        if parameters[row] <= 0.0
    ]
    return found


def require_consistent(subject: Subject, parameters: np.ndarray) -> None:
    """Refuse parameters that no robot has.

    Args:
        subject: The robot.
        parameters: All of them, with or without friction, shape (n,).

    Raises:
        InputError: If they are not as many, one is not finite, or there are inconsistencies.
    """
    found = inconsistencies(subject, parameters)
    if found:
        more = f"; and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(f"{subject.name}: not physically consistent: {found[0]}{more}")


def layout_of(subject: Subject, parameters: np.ndarray) -> Layout:
    """Return the layout of parameters with friction, or without if they are as many."""
    layout = Layout.of(parameter_names(subject))
    bare = Layout.of(parameter_names(subject, friction=False))
    return bare if np.shape(parameters) == (bare.size,) else layout


def central_inertia(parameters: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], centre of mass [m] (3,) and inertia about that [kg m^2] (3, 3).

    Args:
        parameters: The ten of one link, with a mass, shape (10,).
    """
    mass, moment, inertia = link_moments(parameters)
    center = moment / mass
    return mass, center, inertia - mass * (center @ center * np.eye(3) - np.outer(center, center))


def link_faults(parameters: np.ndarray) -> list[str]:
    """Return what is not physical about a link, in words; nothing if it is.

    Args:
        parameters: Its ten, shape (10,).
    """
    if parameters[0] <= 0.0:
        return [f"mass {parameters[0]:.6g} kg; must be positive"]
    low, middle, high = np.linalg.eigvalsh(central_inertia(parameters)[2])
    shown = f"principal moments of inertia [{low:.4g}, {middle:.4g}, {high:.4g}] kg m^2"
    slack = _ROUNDING * abs(np.trace(pseudo_inertia(parameters)[:3, :3]))
    if low < -slack:
        return [f"{shown}; none may be negative"]
    if high > low + middle + slack:
        return [f"{shown}; none may be above the sum of the other two"]
    return []
