"""By how much what is believed of a robot is off the truth."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ModelError:
    """What is believed of a robot of N links, beside what is true of it.

    Attributes:
        mass: Believed mass of each link in units of the true one, shape (N,); scales mass and
            inertia alike, as a wrong density does.
        inertia: Believed inertia about the centre of mass, beyond the factor of the mass,
            shape (N,).
        center: Error of the centre of mass in the link frame [m], shape (N, 3).
        rotor_inertia: Believed rotor inertia in units of the true one, shape (N,).
        stiffness: Believed joint stiffness in units of the true one, shape (N,).
        friction: Believed Coulomb and viscous friction in units of the true ones, shape (2, N).
        link_length: Believed distance from a joint to the next one, the last to the tool point,
            in units of the true one, shape (N,).
        joint_offset: What is believed of each joint's zero, minus the truth [rad or m], shape (N,).
        tool_mass: Added to the believed tool [kg].
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
        """Return no error at all.

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
        """Whether the tool is elsewhere than believed."""
        return bool(np.any(self.link_length != 1.0) or np.any(self.joint_offset != 0.0))
