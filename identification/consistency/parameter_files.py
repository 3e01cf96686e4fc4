"""Physical checks of a robot's parameters, and parameter files from them."""

from dataclasses import replace

import numpy as np

from identification.consistency.pseudo_inertia import Layout, pseudo_inertia
from identification.model.dynamic_parameters import (
    link_moments,
    link_parameters,
    parameter_names,
    transform_parameters,
)
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_parameters import DeltaParameters
from pfsc_drake.robot.models.robot_parameters import (
    ArmParameters,
    BodyParameters,
    FrictionParameters,
    ToolParameters,
)
from pfsc_drake.robot.serial.chain import SerialChain

# of the largest moment of inertia, tolerance of the inequalities for rounding
_ROUNDING = 1e-9


def inconsistencies(subject: Subject, parameters: np.ndarray) -> list[str]:
    """Return the violated physical conditions, one sentence each; nothing for a consistent set.

    Args:
        subject: The robot.
        parameters: All parameters, with or without friction, shape (n,).

    Raises:
        InputError: If their number is wrong, or one is not finite.
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
        parameters: All parameters, with or without friction, shape (n,).

    Raises:
        InputError: If their number is wrong, one is not finite, or there are inconsistencies.
    """
    found = inconsistencies(subject, parameters)
    if found:
        more = f"; and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(f"{subject.name}: not physically consistent: {found[0]}{more}")


def layout_of(subject: Subject, parameters: np.ndarray) -> Layout:
    """Return the layout of parameters with or without friction, by their number."""
    layout = Layout.of(parameter_names(subject))
    without_friction = Layout.of(parameter_names(subject, friction=False))
    return without_friction if np.shape(parameters) == (without_friction.size,) else layout


def central_inertia(parameters: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], centre of mass [m] (3,) and inertia about it [kg m^2] (3, 3).

    Args:
        parameters: The ten parameters of a link with a mass, shape (10,).
    """
    mass, moment, inertia = link_moments(parameters)
    center = moment / mass
    return mass, center, inertia - mass * (center @ center * np.eye(3) - np.outer(center, center))


def link_faults(parameters: np.ndarray) -> list[str]:
    """Return the violated physical conditions of a link in words; nothing if there are none.

    Args:
        parameters: Its ten parameters, shape (10,).
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


SOURCE = "identified; physically consistent"
# of a slide's mass, tolerated difference of slides that have one mass in the file
_EQUAL_SLIDES = 1e-6


def identified_robot(subject: Subject, parameters: np.ndarray) -> ArmParameters:
    """Return a serial robot's parameters with identified links, rotors and friction.

    Geometry, limits, tool, elasticities and variants stay the same. If the tool was identified as
    a part of the last link, it is subtracted with its parameters from the file.

    Args:
        subject: A robot from a parameter file, with all its joints.
        parameters: Identified parameters, with or without friction, shape (n,).

    Raises:
        InputError: If the robot has no such parameters, or not all of its joints, or a link is not
            physical.
    """
    robot, chain = subject.parameters, subject.chain
    if robot is None or chain is None:
        raise InputError(f"{subject.name}: no parameters of links to start from")
    if len(robot.links) != chain.dimension:
        raise InputError(
            f"{subject.name}: {chain.dimension} joints; must be the {len(robot.links)} of "
            f"{robot.name}, since the parameters of welded links cannot be distinguished"
        )
    layout = layout_of(subject, parameters)
    links = links_without_tool(subject, parameters)
    frames = [(link.R_PF, link.p_PF) for link in chain.links[1:]]
    frames.append(flange(chain, robot.tool))
    bodies = [
        _body(old.name, transform_parameters(own, R.T, -R.T @ p))
        for old, own, (R, p) in zip(robot.links, links, frames, strict=True)
    ]
    rotors = replace(robot.rotors, inertia=_rotors(layout, parameters), source=SOURCE)
    return replace(robot, links=bodies, rotors=rotors, friction=_friction(subject, parameters))


def identified_delta(subject: Subject, parameters: np.ndarray) -> DeltaParameters:
    """Return a DELTA robot's parameters with identified masses and friction.

    Only the sums of the masses and their shares of the rods are identifiable: rods and load stay
    the same, slide and plate take the difference.

    Args:
        subject: A DELTA robot.
        parameters: Identified parameters, with or without friction, shape (n,).

    Raises:
        InputError: If the slides differ, or no mass is left for slide or plate.
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
    """Return the ten parameters of each link, the last one without the tool of the file.

    Args:
        subject: A serial robot of N joints.
        parameters: Parameters of the robot, with the tool if it belongs to the subject, shape (n,).

    Returns:
        Shape (N, 10).

    Raises:
        InputError: If the number of parameters is wrong, or one is not finite.
    """
    layout, robot, chain = layout_of(subject, parameters), subject.parameters, subject.chain
    links = layout.check("parameters", parameters)[layout.links]
    if robot is not None and chain is not None and subject.tool:
        links[-1] -= transform_parameters(tool_parameters(robot.tool), *flange(chain, robot.tool))
    return links


def tool_parameters(tool: ToolParameters) -> np.ndarray:
    """Return the ten parameters of a tool in its own frame, shape (10,).

    Args:
        tool: Tool from the robot's file.
    """
    center = tool.center_of_mass
    around = tool.mass * (center @ center * np.eye(3) - np.outer(center, center))
    return link_parameters(tool.mass, center, tool.inertia_matrix() + around)


def flange(chain: SerialChain, tool: ToolParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return orientation and origin [m] of the tool's frame in the last link frame.

    Args:
        chain: The robot with the tool point of the tool.
        tool: Its tool.
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
    """Return identified friction, or the robot's own if none was identified."""
    layout, n = layout_of(subject, parameters), subject.dimension
    if layout.friction.size:
        coulomb, viscous = parameters[layout.friction].reshape(n, 2).T
        return FrictionParameters(coulomb.copy(), viscous.copy(), SOURCE)
    known = [np.zeros(n) if f is None else f.copy() for f in (subject.coulomb, subject.viscous)]
    return FrictionParameters(known[0], known[1], "not identified")
