"""A serial chain of revolute and prismatic joints."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial import newton_euler
from pfsc_drake.robot.serial.links import ChainLink, Linkage


@dataclass(frozen=True)
class SerialChain(Linkage, RobotModel):
    """A chain from the world to a tool point."""

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return len(self.links)

    @property
    def is_massless(self) -> bool:
        """Whether all links have no mass: only the kinematics are modelled."""
        return not self.numeric.gather("mass").any()

    @cached_property
    def reach(self) -> float:
        """Upper bound of the tool point's distance from the origin of the first joint [m]."""
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
            point: Point in that link's frame [m], shape (3,).
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


# tolerance of the triangle inequality of principal moments
_ROUNDING = 1e-9


def nominal_chain(
    chain: SerialChain, error: ModelError, mass: float, p_LC: np.ndarray, tool: str = "tool"
) -> SerialChain:
    """Return the nominal model of a chain.

    Args:
        chain: The actual chain, N links.
        error: Errors of the model, N links.
        mass: Mass of the tool within the last link [kg]; 0 if the link is the tool.
        p_LC: The tool's centre of mass in the last link frame [m], shape (3,).
        tool: Name of the tool's body, for messages.

    Raises:
        InputError: If no body can have the nominal mass properties of the tool.
    """
    links = []
    for i, link in enumerate(chain.links):
        R, p = link.R_PF, link.p_PF
        if i > 0:  # the first joint is fixed in the world, not at the end of a link
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
    links[-1] = _with_other_tool(links[-1], chain.R_LT, error, mass, p_LC, tool)
    return replace(chain, links=tuple(links), p_LT=chain.p_LT * error.link_length[-1])


def _with_other_tool(
    link: ChainLink, R_LT: np.ndarray, error: ModelError, mass: float, p_LC: np.ndarray, tool: str
) -> ChainLink:
    """Return the last link with the nominal mass and centre of the tool.

    The tool's inertia about its own centre is unchanged, so that only two point masses differ.
    """
    mass, p_LC = mass * error.mass[-1], p_LC + error.center[-1]
    moved = p_LC + R_LT @ error.tool_center
    if error.tool_mass == 0.0 and not np.any(error.tool_center * mass):
        return link
    allowed = f"more than {-mass:.4g} kg, the tool's mass"
    if mass == 0.0:
        allowed = f"0 kg or more; '{tool}', which carries the tool frame, has no mass to lose"
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
            f"allowed: values of a body, which has principal moments of inertia unlike "
            f"{np.round(principal, 6).tolist()} kg m^2"
        )
    return replace(link, mass=zeroth, p_LC=center, I_C=I_C)


def _point(p: np.ndarray) -> np.ndarray:
    """Return the inertia of a unit point mass about the origin [m^2], shape (3, 3)."""
    return p @ p * np.eye(3) - np.outer(p, p)


_PARAMETERS = ("mass", "p_LC", "I_C", "reflected_inertia", "stiffness")


@dataclass(frozen=True)
class ParametricChain(SerialChain):
    """Chain with symbols for masses, their centres and inertias, rotor inertias and stiffnesses.

    Expressions of its dynamics contain these symbols. They are the same in all chains
    of N links, so that functions created for one are reused for another.

    Attributes:
        nominal: A chain with numbers, of the same geometry and limits.
    """

    nominal: SerialChain = field(kw_only=True)

    @classmethod
    def of(cls, chain: SerialChain) -> "ParametricChain":
        """Return a chain with symbols in place of its numbers.

        Args:
            chain: The chain, N links; which joints are elastic is no parameter.
        """
        links = []
        for link, symbols in zip(chain.links, _symbols(chain.dimension), strict=True):
            stiffness = symbols["stiffness"] if np.isfinite(link.stiffness) else link.stiffness
            links.append(replace(link, **(symbols | {"stiffness": stiffness})))
        return cls(tuple(links), chain.R_LT, chain.p_LT, chain.gravity, nominal=chain)

    @property
    def numeric(self) -> SerialChain:
        """The robot with numbers for all parameters: itself, unless some are symbols."""
        return self.nominal

    @property
    def elastic_joints(self) -> np.ndarray:
        """Which joints have a finite stiffness, shape (N,) of bool."""
        return self.nominal.elastic_joints

    @property
    def D_M(self) -> ca.SX:
        """Symbols of the rotor inertias, shape (N, 1)."""
        return ca.vertcat(*[link.reflected_inertia for link in self.links])

    @property
    def K_s(self) -> ca.SX:
        """Symbols of the joint stiffnesses, shape (N, 1)."""
        return ca.vertcat(*[link.stiffness for link in self.links])

    @property
    def springs(self) -> ca.SX:
        """Stiffnesses of the elastic joints and zeros of the rigid ones, shape (N, 1)."""
        return ca.vertcat(
            *[
                k if np.isfinite(n) else 0.0
                for k, n in zip(ca.vertsplit(self.K_s), self.nominal.K_s, strict=True)
            ]
        )

    def gather(self, attribute: str) -> np.ndarray:
        """Return one attribute of all links as an array, shape (N,) or (N, ...).

        Raises:
            TypeError: If that is a parameter, which has no value.
        """
        if attribute in _PARAMETERS:
            raise TypeError(f"{attribute}: a symbolic parameter of this robot")
        return self.nominal.gather(attribute)


def chain_parameters(chain: SerialChain) -> dict[str, float]:
    """Return the values of the symbols of :class:`ParametricChain`, by name.

    Args:
        chain: A chain with numbers.
    """
    values: dict[str, float] = {}
    for link, symbols in zip(chain.links, _symbols(chain.dimension), strict=True):
        for attribute, symbol in symbols.items():
            entries = np.ravel(getattr(link, attribute), order="F")
            names = [entry.name() for entry in symbol.elements()]
            values |= dict(zip(names, entries.tolist(), strict=True))
    return values


@cache
def _symbols(num_links: int) -> list[dict[str, ca.SX]]:
    """Return the symbols of each link by attribute."""
    shapes = {"mass": (1, 1), "p_LC": (3, 1), "I_C": (3, 3)}
    return [
        {name: ca.SX.sym(f"{name}_{i}", *shapes.get(name, (1, 1))) for name in _PARAMETERS}
        for i in range(num_links)
    ]
