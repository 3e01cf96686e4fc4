"""Robust gains: tolerated errors of the model, and poles for a required tolerance.

A law for elastic joints computes the links' acceleration from ``K_s (q_M - q_J)`` and commands
their fourth derivative. A relative error ``delta`` of masses or stiffnesses is an error ``delta``
of that acceleration, and enters the fourth derivative times the square of the joint's resonance,
like a wrong coefficient of ``y''``. The loop tolerates it while its own coefficient is larger::

    p_3 p_4 > about delta omega_res^2 / 1..3

with the two fastest poles ``p_3, p_4``. Two slow poles determine the convergence, two fast ones
the robustness; sampling limits the fast ones. The rule gives candidates, the sampled loop at rest
(:class:`LoopAtRest`) decides.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.loop_at_rest import LoopAtRest
from pfsc_drake.control.law.stabilization import LoopGains
from pfsc_drake.control.margins import modes

# ratio of a fast pair, so that no two poles are equal
_PAIR = 1.4
# largest fast pole per sampling interval
_FASTEST = 0.45
_CANDIDATES = 16
# share of the bandwidth that the slowest mode must retain with the error
_RETAINED = 0.5
_LARGEST_ERROR, _BISECTIONS = 0.3, 6


@dataclass(frozen=True)
class RobotError:
    """Error of the nominal model: nominal parameters relative to the actual ones.

    Attributes:
        mass: Factor of the links' masses and inertias.
        stiffness: Factor of the joint stiffnesses.
    """

    mass: float = 1.0
    stiffness: float = 1.0

    def __str__(self) -> str:
        """In words."""
        parts = {"masses": self.mass, "joint stiffnesses": self.stiffness}
        return " and ".join(
            f"nominal {name} {100.0 * abs(factor - 1.0):.2g} % too "
            f"{'low' if factor < 1.0 else 'high'}"
            for name, factor in parts.items()
            if factor != 1.0
        )


@dataclass(frozen=True)
class SampledRobot:
    """Sampled loop of a law and a robot at rest.

    Attributes:
        loop: The loop, for any gains.
        period: Sampling time [s].
        is_elastic: Whether the robot has stiffnesses that may be wrong.
    """

    loop: LoopAtRest
    period: float
    is_elastic: bool

    @once_per_content()
    def rate(self, gains: LoopGains, error: RobotError) -> float:
        """Return the rate of the slowest or of the fastest growing mode [1/s].

        Args:
            gains: Gains of all coordinates.
            error: Error of the nominal model.
        """
        A = self.loop.closed_loop(gains, 1.0 / error.mass, 1.0 / error.stiffness)
        return modes(A, self.period).slowest

    def errors(self, size: float) -> Iterator[RobotError]:
        """Iterate over errors of one kind at a time.

        Args:
            size: Relative size of the errors.
        """
        for factor in (1.0 - size, 1.0 + size):
            yield RobotError(mass=factor)
            if self.is_elastic:
                yield RobotError(stiffness=factor)

    def corners(self, size: float) -> Iterator[RobotError]:
        """Iterate over errors of one kind at a time, and of both.

        Args:
            size: Relative size of the errors.
        """
        yield from self.errors(size)
        if self.is_elastic:
            for mass in (1.0 - size, 1.0 + size):
                for stiffness in (1.0 - size, 1.0 + size):
                    yield RobotError(mass, stiffness)

    def destabilizing_error(self, gains: LoopGains, size: float) -> RobotError | None:
        """Return the error of one kind with the least stable loop; None if all loops are stable.

        Args:
            gains: Gains of all coordinates.
            size: Relative size of the errors.
        """
        worst = max(self.errors(size), key=lambda error: self.rate(gains, error))
        return worst if self.rate(gains, worst) > 0.0 else None

    def largest_error(self, gains: LoopGains, direction: RobotError) -> float:
        """Return the largest tolerated relative error in one direction, up to 0.3.

        Args:
            gains: Gains of all coordinates.
            direction: Error of any size, with the wrong parameters and their signs.
        """

        def error(size: float) -> RobotError:
            return RobotError(
                1.0 + size * np.sign(direction.mass - 1.0),
                1.0 + size * np.sign(direction.stiffness - 1.0),
            )

        low, high = 0.0, _LARGEST_ERROR
        if self.rate(gains, error(high)) <= 0.0:
            return high
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if self.rate(gains, error(middle)) <= 0.0:
                low = middle
            else:
                high = middle
        return low


def rule_of_poles(bandwidth: float, fast: float, relative_degree: int) -> list[float]:
    """Return two slow poles, and fast ones for the remaining ones of a law [1/s].

    Args:
        bandwidth: Bandwidth of the convergence, positive [1/s].
        fast: Slower one of the fast poles, positive [1/s].
        relative_degree: ``r``, 1 to 4.
    """
    slow, further = [-bandwidth] * min(relative_degree, 2), [-fast, -_PAIR * fast]
    return slow + further[: max(relative_degree - 2, 0)]


def choose_fast_pole(
    robot: SampledRobot,
    gains: Callable[[float], LoopGains],
    bandwidths: Sequence[float],
    error: float,
) -> float:
    """Return the slowest fast pole with which an error of the model is tolerated [1/s].

    Tolerated means that all modes retain half of the smallest bandwidth with masses and stiffnesses
    wrong by the error, one and both at a time. If no pole suffices, the best one is returned.

    Args:
        robot: Law and robot.
        gains: Gains of all coordinates for a fast pole.
        bandwidths: Bandwidths of the coordinates, positive [1/s].
        error: Relative error.
    """
    slowest, fastest = max(bandwidths), max(_FASTEST / robot.period, 1.01 * max(bandwidths))
    rates = {}
    for fast in np.geomspace(slowest, fastest, _CANDIDATES):
        tried = gains(float(fast))
        rates[float(fast)] = max(robot.rate(tried, wrong) for wrong in robot.corners(error))
        if rates[float(fast)] <= -_RETAINED * min(bandwidths):
            return float(fast)
    return min(rates, key=lambda fast: rates[fast])
