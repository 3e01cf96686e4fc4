"""A serial chain of revolute and prismatic joints."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial import newton_euler
from pfsc_drake.robot.serial.links import Linkage


@dataclass(frozen=True)
class SerialChain(Linkage, RobotModel):
    """A chain from the world to a tool point."""

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return len(self.links)

    @cached_property
    def reach(self) -> float:
        """How far the tool point can be from the origin of the first joint at most [m]."""
        offsets = [np.linalg.norm(link.p_PF) for link in self.links[1:]]
        slides = [np.abs(link.position_limits).max() for link in self.links if not link.is_revolute]
        return float(sum(offsets) + np.linalg.norm(self.p_LT) + sum(slides))

    def gather(self, attribute: str) -> np.ndarray:
        """Return one attribute of all links as an array, shape (N,) or (N, ...)."""
        return np.array([getattr(link, attribute) for link in self.links])

    def up_to(self, link: int, point: np.ndarray) -> "SerialChain":
        """Return the chain that ends with a link and has a point of it as its tool point.

        Args:
            link: Index of the link, from 0.
            point: In that link's frame [m], shape (3,).
        """
        return replace(self, links=self.links[: link + 1], R_LT=np.eye(3), p_LT=point)

    def tool_pose(self, q: Sequence[Jet]) -> tuple[Jet, Jet]:
        """Return tool point [m] and orientation, see :func:`newton_euler.tool_pose`."""
        return newton_euler.tool_pose(self, newton_euler.link_motions(self, q))

    def inverse_dynamics(self, q: Sequence[Jet]) -> list[Jet]:
        """Return the link-side torques, see :func:`newton_euler.inverse_dynamics`."""
        return newton_euler.inverse_dynamics(self, q)

    def mass_matrix(self, q: ca.SX) -> ca.SX:
        """Return the link-side mass matrix, see :func:`newton_euler.mass_matrix`."""
        return newton_euler.mass_matrix(self, q)
