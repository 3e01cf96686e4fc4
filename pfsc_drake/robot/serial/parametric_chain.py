"""A serial chain whose mass and stiffness parameters are symbols.

A law that is made for it is a function of these parameters, too: made and differentiated once, it
is evaluated for whatever is believed of the robot.
"""

from dataclasses import dataclass, field, replace
from functools import cache

import casadi as ca
import numpy as np

from pfsc_drake.robot.serial.chain import SerialChain

_PARAMETERS = ("mass", "p_LC", "I_C", "reflected_inertia", "stiffness")


@dataclass(frozen=True)
class ParametricChain(SerialChain):
    """A chain with symbols for masses, their places and inertias, rotor inertias and stiffnesses.

    Expressions of its dynamics have these symbols in them, free. They are the same in all chains
    of N links, so that what was made of one is found again for another.

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
        """See :class:`RobotModel`."""
        return self.nominal

    @property
    def elastic_joints(self) -> np.ndarray:
        """See :class:`RobotModel`."""
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
        """See :class:`RobotModel`."""
        return ca.vertcat(
            *[
                k if np.isfinite(n) else 0.0
                for k, n in zip(ca.vertsplit(self.K_s), self.nominal.K_s, strict=True)
            ]
        )

    def gather(self, attribute: str) -> np.ndarray:
        """See :class:`RobotModel`.

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
