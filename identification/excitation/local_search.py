"""Local search for an optimal motion from a random one, within the limits at all times.

The solver applies the limits at some instants. If its motion exceeds a limit in between, the
instant of the worst excess is added and the search continues (exchange method of semi-infinite
programming).
"""

from dataclasses import dataclass

import numpy as np

from identification.excitation.excitation_program import ExcitationProblem, ExcitationProgram
from identification.excitation.fourier import fourier_basis

# instants per period of the highest harmonic: initial ones, and for the detection of excesses
_COARSE_JOINTS, _COARSE_POSTURES, _FINE = 10, 12, 100
_SAMPLES = 20  # of the criterion per period of the highest harmonic
_MOST_ROUNDS = 8

_START_SHARE = 0.7  # of the joint limits, used by a random motion
_START_OFFSET = 0.4  # of the range, largest distance of its middle from that of the limits
_POSTURES = 500
_MOST_TRIALS = 4
_FROM_NEAR = 0.4  # share of a random motion in a start near a known one
# tolerated relative excess of a limit before an instant is added
_ENOUGH = 1e-3


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """Result of one local search.

    Attributes:
        seed: Seed of the initial random motion.
        coefficients: Coefficients of the motion, shape (N, 2M + 1).
        value: Cost, see :class:`ExcitationCost`.
        excess: Largest excess of a limit, relative (to the range of positions and so on) or in m
            for clearances; not positive if all are satisfied.
        limit: Name of that limit.
        rounds: Number of runs of the solver.
    """

    seed: int
    coefficients: np.ndarray
    value: float
    excess: float
    limit: str
    rounds: int


class LocalSearch:
    """Local searches for one robot's problem.

    Args:
        problem: Problem of the robot.
    """

    def __init__(self, problem: ExcitationProblem) -> None:
        highest = max(problem.harmonics)
        least = -(-problem.kernels[0].size2_out(0) // problem.dimension)
        self.problem = problem
        self._program = ExcitationProgram(problem, max(_SAMPLES * highest, 2 * least))
        self._fine = _instants(problem, _FINE)
        self._bases = fourier_basis(self._fine, problem.period, problem.harmonics)
        posture = problem.posture
        self._torque = problem.torque.map(len(self._fine))
        self._posture = None if posture is None else posture.function.map(len(self._fine))

    def run(self, seed: int, iterations: int, near: np.ndarray | None = None) -> LocalOptimum:
        """Return the local optimum from a random motion.

        Args:
            seed: Seed of the random motion.
            iterations: Largest number of iterations of the solver; a quarter of them after instants
                have been added.
            near: Coefficients of a motion to start near, shape (N, 2M + 1); anywhere if omitted.
        """
        random = np.random.default_rng(seed)
        for _ in range(_MOST_TRIALS):
            start = random_start(self.problem, random)
            if near is not None:
                start = near + _FROM_NEAR * (start - near)
            optimum = self.improve(start, seed, iterations)
            # occasionally the search for allowed postures ends with a joint at rest
            if np.isfinite(optimum.value):
                break
        return optimum

    def improve(self, coefficients: np.ndarray, seed: int, iterations: int) -> LocalOptimum:
        """Return the local optimum from a motion.

        Args:
            coefficients: Coefficients of the motion, shape (N, 2M + 1).
            seed: Seed of its origin.
            iterations: Largest number of iterations of the solver; a quarter of them after instants
                have been added.
        """
        problem = self.problem
        joint_times = _instants(problem, _COARSE_JOINTS)
        posture_times = _instants(problem, _COARSE_POSTURES)
        left, rounds = iterations, 0
        while True:
            rounds += 1
            coefficients, value = self._program.solve(
                coefficients, joint_times, posture_times, left
            )
            joints, postures = self._excesses(coefficients)
            worst = max((*joints, *postures), key=lambda item: item[1].max())
            excess = float(worst[1].max())
            left = max(iterations // 4, 1)
            if excess <= _ENOUGH or rounds == _MOST_ROUNDS:
                return LocalOptimum(seed, coefficients, value, excess, worst[0], rounds)
            joint_times = self._with_peaks(joint_times, [values for _, values in joints])
            posture_times = self._with_peaks(posture_times, [values for _, values in postures])

    def _excesses(
        self, coefficients: np.ndarray
    ) -> tuple[list[tuple[str, np.ndarray]], list[tuple[str, np.ndarray]]]:
        """Return the excess of each limit at all fine instants, each (K, n)."""
        limits = self.problem.limits
        q, v, a = (basis @ coefficients.T for basis in self._bases)
        joints = [
            ("position", np.abs((q - limits.middle) / limits.reach) - 1.0),
            ("velocity", np.abs(v / limits.velocity) - 1.0),
            ("acceleration", np.abs(a / limits.acceleration) - 1.0),
        ]
        tau = np.array(self._torque(q.T, v.T, a.T)).T
        others = [("effort", np.abs(tau / limits.effort) - 1.0)]
        if self._posture is not None:
            assert self.problem.posture is not None
            g = np.array(self._posture(q.T)).T
            names = self.problem.posture.names
            others += [(name, -g[:, [i]]) for i, name in enumerate(names)]
        return joints, others

    def _with_peaks(self, times: np.ndarray, excesses: list[np.ndarray]) -> np.ndarray:
        """Return instants with those of the largest excess of each limit added."""
        added = [times]
        for values in np.concatenate(excesses, axis=1).T:
            before, after = np.roll(values, 1), np.roll(values, -1)
            peak = (values > _ENOUGH / 2.0) & (values >= before) & (values > after)
            added.append(self._fine[peak])
        return np.unique(np.concatenate(added))


def random_start(problem: ExcitationProblem, random: np.random.Generator) -> np.ndarray:
    """Return coefficients of a random motion within the joint limits, shape (N, 2M + 1)."""
    limits, middle = problem.limits, _random_posture(problem, random)
    coefficients = np.empty(problem.shape)
    coefficients[:, 0] = middle
    coefficients[:, 1:] = random.normal(size=(problem.dimension, problem.shape[1] - 1))
    bases = fourier_basis(_instants(problem, _FINE), problem.period, problem.harmonics)
    margin = limits.reach - np.abs(middle - limits.middle)
    largest = [margin, limits.velocity, limits.acceleration]
    shares = [
        np.abs(basis[:, 1:] @ coefficients[:, 1:].T).max(axis=0) / most
        for basis, most in zip(bases, largest, strict=True)
    ]
    coefficients[:, 1:] *= (_START_SHARE / np.max(shares, axis=0))[:, None]
    return coefficients


def _random_posture(problem: ExcitationProblem, random: np.random.Generator) -> np.ndarray:
    """Return the best of some random postures, by their least margin."""
    limits = problem.limits
    offsets = _START_OFFSET * random.uniform(-1.0, 1.0, (_POSTURES, problem.dimension))
    postures = limits.middle + offsets * limits.reach
    if problem.posture is None:
        return postures[0]
    least = problem.posture.values(postures).min(axis=1)
    fit = np.flatnonzero(least > 0.0)
    return postures[fit[0] if fit.size else np.argmax(least)]


def _instants(problem: ExcitationProblem, per_period: int) -> np.ndarray:
    count = per_period * max(problem.harmonics)
    return np.arange(count) * problem.period / count
