"""Errors of a controller's nominal model of a robot."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ModelError:
    """Errors of the nominal model of a robot of N links, relative to the actual robot.

    Attributes:
        mass: Nominal mass of each link over the actual one, shape (N,); scales mass and
            inertia alike, as a wrong density does.
        inertia: Nominal inertia about the centre of mass over the actual one, beyond the factor of
            the mass, shape (N,).
        center: Error of the centre of mass in the link frame [m], shape (N, 3).
        rotor_inertia: Nominal rotor inertia over the actual one, shape (N,).
        stiffness: Nominal joint stiffness over the actual one, shape (N,).
        friction: Nominal Coulomb and viscous friction over the actual ones, shape (2, N).
        link_length: Nominal distance from a joint to the next one, the last to the tool point,
            over the actual one, shape (N,).
        joint_offset: Nominal minus actual zero of each joint [rad or m], shape (N,).
        tool_mass: Error of the tool's mass, added to the nominal tool [kg].
        tool_center: Error of the tool's centre of mass, axes of the tool frame [m], shape (3,).
    """

    mass: np.ndarray
    inertia: np.ndarray
    center: np.ndarray
    rotor_inertia: np.ndarray
    stiffness: np.ndarray
    friction: np.ndarray
    link_length: np.ndarray
    joint_offset: np.ndarray
    tool_mass: float
    tool_center: np.ndarray

    @classmethod
    def none(cls, num_links: int) -> "ModelError":
        """Return the errors of an exact model.

        Args:
            num_links: ``N``.
        """
        one = np.ones(num_links)
        return cls(
            mass=one,
            inertia=one,
            center=np.zeros((num_links, 3)),
            rotor_inertia=one,
            stiffness=one,
            friction=np.ones((2, num_links)),
            link_length=one,
            joint_offset=np.zeros(num_links),
            tool_mass=0.0,
            tool_center=np.zeros(3),
        )

    @property
    def moves_tool(self) -> bool:
        """Whether the tool's nominal pose differs from the actual one."""
        return bool(np.any(self.link_length != 1.0) or np.any(self.joint_offset != 0.0))
