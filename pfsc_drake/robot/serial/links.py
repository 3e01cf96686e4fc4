"""Links of a serial chain, as data."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class ChainLink:
    """One joint and the link that it moves.

    The link frame L is the joint's moving frame; the joint's fixed frame F is
    given in the previous link's frame P (the world frame for the first joint).

    Attributes:
        name: Name of the joint.
        kind: ``revolute`` (q in rad) or ``prismatic`` (q in m).
        R_PF: Orientation of F in P, shape (3, 3).
        p_PF: Origin of F in P [m], shape (3,).
        axis: Unit vector of the joint axis in F (and L), shape (3,).
        mass: Mass of everything fixed to the link [kg].
        p_LC: Centre of mass in L [m], shape (3,).
        I_C: Inertia about the centre of mass, axes of L [kg m^2], shape (3, 3).
        reflected_inertia: Rotor inertia on the joint side, an entry of D_M.
        stiffness: Joint stiffness K_s [Nm/rad or N/m]; infinite when rigid.
        damping: Joint damping K_d [Nm s/rad or N s/m] of an elastic joint.
        viscous_damping: Damping at the drive, of a rigid joint or of an elastic joint's motor
            [Nm s/rad or N s/m].
        effort_limit: Drive torque or force limit [Nm or N].
        position_limits: Lower and upper limit of q.
        velocity_limit: Limit of the magnitude of q'.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    R_PF: np.ndarray
    p_PF: np.ndarray
    axis: np.ndarray
    mass: float
    p_LC: np.ndarray
    I_C: np.ndarray
    reflected_inertia: float = 0.0
    stiffness: float = np.inf
    damping: float = 0.0
    viscous_damping: float = 0.0
    effort_limit: float = np.inf
    position_limits: tuple[float, float] = (-np.inf, np.inf)
    velocity_limit: float = np.inf

    @property
    def is_revolute(self) -> bool:
        """Whether the joint turns (else it slides)."""
        return self.kind == "revolute"

    @property
    def inertia_about_origin(self) -> np.ndarray:
        """Inertia about the link frame's origin, axes of L [kg m^2], shape (3, 3)."""
        c = self.p_LC
        return self.I_C + self.mass * (c @ c * np.eye(3) - np.outer(c, c))


@dataclass(frozen=True)
class Linkage:
    """Links from the world to a tool point.

    Attributes:
        links: Joints and links from the base to the tool.
        R_LT: Orientation of the tool frame T in the last link frame, shape (3, 3).
        p_LT: Tool point in the last link frame [m], shape (3,).
        gravity: Gravitational acceleration in world axes [m/s^2], shape (3,).
    """

    links: tuple[ChainLink, ...]
    R_LT: np.ndarray = field(default_factory=lambda: np.eye(3))
    p_LT: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gravity: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
