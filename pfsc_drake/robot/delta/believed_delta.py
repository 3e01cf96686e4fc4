"""A DELTA robot as it is believed to be."""

from dataclasses import replace

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.model_error import ModelError


def believed_delta(robot: DeltaRobot, error: ModelError) -> DeltaRobot:
    """Return what is believed of a DELTA robot.

    Its three kinds of links are slides, rods and end-effector with load; the lengths that belong
    to them are ``l_A``, ``l_BC`` and ``l_EC``.

    Args:
        robot: The true one.
        error: By how much it is off, N = 3.

    Raises:
        InputError: If the robot cannot be like that, or has nothing that could be.
    """
    if np.any(error.joint_offset):
        raise InputError(
            f"joint_offset = {error.joint_offset.tolist()}; allowed: 0 for a DELTA robot, whose "
            "slides are homed at their ends"
        )
    masses, geometry = robot.parameters.masses, robot.parameters.geometry
    slide, rod, plate = error.mass
    load = masses.load * plate + error.tool_mass
    if load < 0.0:
        raise InputError(
            f"tool_mass = {error.tool_mass:g} kg; allowed: {-masses.load * plate:g} kg or more"
        )
    l_A, l_BC, l_EC = error.link_length
    return DeltaRobot(
        replace(
            robot.parameters,
            masses=replace(
                masses,
                slide=masses.slide * slide,
                rod_pair=masses.rod_pair * rod,
                plate=masses.plate * plate,
                load=load,
            ),
            geometry=replace(
                geometry,
                l_A=geometry.l_A * l_A,
                l_BC=geometry.l_BC * l_BC,
                l_EC=geometry.l_EC * l_EC,
            ),
        )
    )
