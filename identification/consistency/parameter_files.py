"""Robot parameters, as files hold them, with identified values."""

from dataclasses import replace

import numpy as np

from identification.consistency.check import central_inertia, layout_of
from identification.consistency.layout import Layout
from identification.model.analytic_base import moved
from identification.model.parameters import link_parameters
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.parameters import DeltaParameters
from pfsc_drake.robot.models.parameters import (
    BodyParameters,
    FrictionParameters,
    RobotParameters,
    ToolParameters,
)
from pfsc_drake.robot.serial.chain import SerialChain

SOURCE = "identified; physically consistent"
# of a slide's mass, by which slides that the file holds as one may differ
_EQUAL_SLIDES = 1e-6


def identified_robot(subject: Subject, parameters: np.ndarray) -> RobotParameters:
    """Return a serial robot's parameters with identified links, rotors and friction.

    Geometry, limits, tool, elasticities and variants stay. If the tool was identified as a part of
    the last link, what the file says of it is taken off.

    Args:
        subject: A robot that was read from parameters in a file, with all its joints.
        parameters: Identified ones, with or without friction, shape (n,).

    Raises:
        InputError: If the robot has no such parameters, or not all of its joints, or a link is
            not physical.
    """
    robot, chain = subject.parameters, subject.chain
    if robot is None or chain is None:
        raise InputError(f"{subject.name}: no parameters of links to start from")
    if len(robot.links) != chain.dimension:
        raise InputError(
            f"{subject.name}: {chain.dimension} joints; must be the {len(robot.links)} of "
            f"{robot.name}, since what is welded cannot be told apart"
        )
    layout = layout_of(subject, parameters)
    links = links_without_tool(subject, parameters)
    frames = [(link.R_PF, link.p_PF) for link in chain.links[1:]]
    frames.append(flange(chain, robot.tool))
    bodies = [
        _body(old.name, moved(own, R.T, -R.T @ p))
        for old, own, (R, p) in zip(robot.links, links, frames, strict=True)
    ]
    rotors = replace(robot.rotors, inertia=_rotors(layout, parameters), source=SOURCE)
    return replace(robot, links=bodies, rotors=rotors, friction=_friction(subject, parameters))


def identified_delta(subject: Subject, parameters: np.ndarray) -> DeltaParameters:
    """Return a DELTA robot's parameters with identified masses and friction.

    Of the masses with their shares of the rods only the sums are identifiable: rods and load stay,
    slide and plate take the difference.

    Args:
        subject: A DELTA robot.
        parameters: Identified ones, with or without friction, shape (n,).

    Raises:
        InputError: If the slides differ, or nothing would be left of slide or plate.
    """
    assert subject.delta is not None
    layout, robot = layout_of(subject, parameters), subject.delta.parameters
    parameters = layout.check("parameters", parameters)
    slides, plate = parameters[layout.slides], float(parameters[layout.masses[-1]])
    if np.ptp(slides) > _EQUAL_SLIDES * np.abs(slides).max():
        raise InputError(
            f"{subject.name}: slides of {slides.tolist()} kg; must be equal, as the robot's "
            "parameters have one for all"
        )
    masses = robot.masses
    changed = {
        "slide": float(slides.mean()) - masses.effective_slide + masses.slide,
        "plate": plate - masses.effective_plate + masses.plate,
    }
    for name, mass in changed.items():
        if mass <= 0.0:
            raise InputError(
                f"{subject.name}: {mass:.4g} kg left for the {name} beside rods and load; must be "
                "positive"
            )
    masses = replace(masses, **changed, source=SOURCE)
    return replace(robot, masses=masses, friction=_friction(subject, parameters))


def links_without_tool(subject: Subject, parameters: np.ndarray) -> np.ndarray:
    """Return the ten parameters of each link, of the last one without the tool of the file.

    Args:
        subject: A serial robot of N joints.
        parameters: Of the robot, with the tool if it belongs to the subject, shape (n,).

    Returns:
        Shape (N, 10).

    Raises:
        InputError: If there are not as many parameters, or one is not finite.
    """
    layout, robot, chain = layout_of(subject, parameters), subject.parameters, subject.chain
    links = layout.check("parameters", parameters)[layout.links]
    if robot is not None and chain is not None and subject.tool:
        tool, center = robot.tool, robot.tool.center_of_mass
        around = tool.mass * (center @ center * np.eye(3) - np.outer(center, center))
        own = link_parameters(tool.mass, center, tool.inertia_matrix() + around)
        links[-1] -= moved(own, *flange(chain, tool))
    return links


def flange(chain: SerialChain, tool: ToolParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return orientation and origin [m] of the tool's frame in the last link frame.

    Args:
        chain: The robot with the tool point of the tool.
        tool: What it carries.
    """
    return chain.R_LT, chain.p_LT - chain.R_LT @ tool.tool_point


def _body(name: str, parameters: np.ndarray) -> BodyParameters:
    if parameters[0] <= 0.0:
        raise InputError(f"{name}: mass {parameters[0]:.6g} kg without the tool; must be positive")
    mass, center, I_C = central_inertia(parameters)
    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    try:
        return BodyParameters(name, float(mass), center, I_C[rows, columns], SOURCE)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _rotors(layout: Layout, parameters: np.ndarray) -> np.ndarray:
    for row in layout.rotors:
        if parameters[row] <= 0.0:
            raise InputError(
                f"{layout.names[row]} = {parameters[row]:.4g} kg m^2; must be positive in a file"
            )
    return parameters[layout.rotors].copy()


def _friction(subject: Subject, parameters: np.ndarray) -> FrictionParameters:
    """Return identified friction; that of the robot where none was identified."""
    layout, n = layout_of(subject, parameters), subject.dimension
    if layout.friction.size:
        coulomb, viscous = parameters[layout.friction].reshape(n, 2).T
        return FrictionParameters(coulomb.copy(), viscous.copy(), SOURCE)
    known = [np.zeros(n) if f is None else f.copy() for f in (subject.coulomb, subject.viscous)]
    return FrictionParameters(known[0], known[1], "not identified")
