"""Drive demand of a motion as a polynomial of its speed scaling and the scaling's derivatives."""

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from pfsc_drake.control.planning.drive_demand import DriveDemand, apply_scaling

# exponents of (c, c', c'', c''') in every monomial of weight up to 4: the k-th derivative of the
# joint coordinates has the weight k, and so has each of its terms in (planning-scaling)
_EXPONENTS = (
    (0, 0, 0, 0),
    (1, 0, 0, 0),
    (2, 0, 0, 0),
    (0, 1, 0, 0),
    (3, 0, 0, 0),
    (1, 1, 0, 0),
    (0, 0, 1, 0),
    (4, 0, 0, 0),
    (2, 1, 0, 0),
    (0, 2, 0, 0),
    (1, 0, 1, 0),
    (0, 0, 0, 1),
)
# number of random sample sets; the best conditioned one determines the coefficients
_TRIALS = 100


def exponents(highest: int) -> list[tuple[int, ...]]:
    """Return the exponents of ``(c, c', c'', c''')`` in the monomials of a demand.

    Args:
        highest: Highest derivative of the joint coordinates that it depends on, 2 to 4.
    """
    return [powers for powers in _EXPONENTS if _weight(powers) <= highest]


def _weight(powers: tuple[int, ...]) -> int:
    return sum((k + 1) * power for k, power in enumerate(powers))


@dataclass(frozen=True)
class DemandPolynomial:
    """Drive torques along a trajectory, ``tau = sum_m a_m c^i c'^j c''^k c'''^l``.

    At a given posture the inverse dynamics is a polynomial of the joint derivatives, and these are
    polynomials of the speed scaling ``c`` and its time derivatives. Elastic joints have twelve
    monomials, from gravity to ``c^4`` and ``c'''``, rigid joints four. The coefficients are
    computed once from as many values, and are exact up to rounding.

    Attributes:
        exponents: Exponents of the M monomials.
        coefficients: Coefficients a_m, shape (samples, M, N).
    """

    exponents: list[tuple[int, ...]]
    coefficients: np.ndarray

    @classmethod
    def of(cls, demand: DriveDemand, trajectory: np.ndarray, scale: float) -> "DemandPolynomial":
        """Return the polynomials of a trajectory.

        Args:
            demand: Drive demand of a motion.
            trajectory: Joint coordinates and derivatives at scaling 1, shape (samples, K + 1, N).
            scale: Time in which the scaling may change [s]; affects rounding only.
        """
        powers = exponents(demand.derivatives)
        scalings = _well_conditioned(powers) * scale ** -np.arange(4.0)
        values = np.array([_torques(demand, trajectory, scaling) for scaling in scalings])
        # each in units of its own size
        size = np.array([scale ** -sum(k * p for k, p in enumerate(power)) for power in powers])
        table = _monomials(powers, scalings) / size
        found = np.linalg.solve(table, values.reshape(len(powers), -1)).reshape(values.shape)
        return cls(powers, (found / size[:, None, None]).transpose(1, 0, 2))

    def plus(self, torques: np.ndarray) -> "DemandPolynomial":
        """Return the polynomials plus torques that do not depend on the scaling, (samples, N)."""
        coefficients = self.coefficients.copy()
        coefficients[:, 0] += torques
        return replace(self, coefficients=coefficients)

    def torques(self, rates: np.ndarray) -> np.ndarray:
        """Return the torques at a speed scaling, shape (samples, N).

        Args:
            rates: ``c, c', c'', c'''``, shape (samples, 4).
        """
        return np.einsum("smn,sm->sn", self.coefficients, _monomials(self.exponents, rates))


def _torques(demand: DriveDemand, trajectory: np.ndarray, scaling: np.ndarray) -> np.ndarray:
    both = demand.of(apply_scaling(trajectory, np.tile(scaling, (len(trajectory), 1))))
    return both[:, : both.shape[1] // 2]


def _monomials(powers: list[tuple[int, ...]], rates: np.ndarray) -> np.ndarray:
    terms = [prod(rates[..., k] ** p for k, p in enumerate(power)) for power in powers]
    return np.stack(np.broadcast_arrays(*terms), axis=-1)


def _well_conditioned(powers: list[tuple[int, ...]]) -> np.ndarray:
    """Return the M scalings that determine the coefficients best, shape (M, 4)."""
    rng = np.random.default_rng(0)
    trials = rng.uniform(-1.0, 1.0, (_TRIALS, len(powers), 4))
    condition = [np.linalg.cond(_monomials(powers, trial)) for trial in trials]
    return trials[int(np.argmin(condition))]
