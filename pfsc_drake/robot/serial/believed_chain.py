"""A serial chain as it is believed to be."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink

# by which the sum of two principal moments may be below the third
_ROUNDING = 1e-9


@dataclass(frozen=True)
class ToolMass:
    """The tool among what is fixed to the last link.

    Attributes:
        mass: [kg]; 0 where the last link is the tool.
        p_LC: Its centre of mass in the last link frame [m], shape (3,).
        name: Of its body, for messages.
    """

    mass: float
    p_LC: np.ndarray
    name: str = "tool"


def believed_chain(chain: SerialChain, error: ModelError, tool: ToolMass) -> SerialChain:
    """Return what is believed of a chain.

    Args:
        chain: The true one, N links.
        error: By how much it is off, N links.
        tool: The tool on it.

    Raises:
        InputError: If no body can have the believed mass properties of the tool.
    """
    links = []
    for i, link in enumerate(chain.links):
        R, p = link.R_PF, link.p_PF
        if i > 0:  # the first joint stands in the world, at the end of no link
            p = p * error.link_length[i - 1]
        offset = error.joint_offset[i]
        if link.is_revolute:
            turn = Rotation.from_rotvec(offset * link.axis).as_matrix()
            R = R @ turn if offset else R
        else:
            p = p + offset * (R @ link.axis)
        links.append(
            replace(
                link,
                R_PF=R,
                p_PF=p,
                mass=link.mass * error.mass[i],
                p_LC=link.p_LC + error.center[i],
                I_C=link.I_C * error.mass[i] * error.inertia[i],
                reflected_inertia=link.reflected_inertia * error.rotor_inertia[i],
                stiffness=link.stiffness * error.stiffness[i],
            )
        )
    links[-1] = _with_other_tool(links[-1], chain.R_LT, error, tool)
    return replace(chain, links=tuple(links), p_LT=chain.p_LT * error.link_length[-1])


def _with_other_tool(
    link: ChainLink, R_LT: np.ndarray, error: ModelError, tool: ToolMass
) -> ChainLink:
    """Return the last link with the tool's mass and centre as believed.

    The tool's inertia about its own centre stays, so that only two point masses differ.
    """
    mass, p_LC = tool.mass * error.mass[-1], tool.p_LC + error.center[-1]
    moved = p_LC + R_LT @ error.tool_center
    if error.tool_mass == 0.0 and not np.any(error.tool_center * mass):
        return link
    allowed = f"more than {-mass:.4g} kg, the tool's mass"
    if mass == 0.0:
        allowed = f"0 kg or more; '{tool.name}', which carries the tool frame, has no mass to lose"
    if not mass + error.tool_mass > 0.0:
        raise InputError(f"tool_mass = {error.tool_mass:g} kg; allowed: {allowed}")
    # moments of mass of order 0, 1, 2 about the link's origin add up
    zeroth = link.mass + error.tool_mass
    first = link.mass * link.p_LC - mass * p_LC + (mass + error.tool_mass) * moved
    I_L = link.inertia_about_origin - mass * _point(p_LC)
    I_L = I_L + (mass + error.tool_mass) * _point(moved)
    center = first / zeroth
    I_C = I_L - zeroth * _point(center)
    principal = np.linalg.eigvalsh(I_C)
    if principal[0] < 0.0 or principal[:2].sum() < principal[2] * (1.0 - _ROUNDING):
        raise InputError(
            f"tool_mass = {error.tool_mass:g} kg, tool_center = {error.tool_center.tolist()} m; "
            f"allowed: those of a body, which has principal moments of inertia unlike "
            f"{np.round(principal, 6).tolist()} kg m^2"
        )
    return replace(link, mass=zeroth, p_LC=center, I_C=I_C)


def _point(p: np.ndarray) -> np.ndarray:
    """Return the inertia of a unit point mass about the origin [m^2], shape (3, 3)."""
    return p @ p * np.eye(3) - np.outer(p, p)
