"""Gains that bear errors of the model: how much given ones bear, and poles that bear enough.

A law for elastic joints takes the links' acceleration from ``K_s (q_M - q_J)`` and commands their
fourth derivative. A relative error ``delta`` of masses or stiffnesses is an error ``delta`` of that
acceleration, and enters the fourth derivative multiplied by the square of the joint's resonance,
like a wrong coefficient of ``y''``. The loop bears it while its own coefficient is larger::

    p_3 p_4 > about delta omega_res^2 / 1..3

with the two fastest poles ``p_3, p_4``. Two slow poles give the wanted convergence, two fast ones
the robustness; the fast ones end where the sampling does. The rule says where to look, the sampled
loop at rest (:class:`LoopAtRest`) whether it is so.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.loop_at_rest import LoopAtRest
from pfsc_drake.control.law.stabilization import LoopGains
from pfsc_drake.control.margins import modes

# of a fast pair, so that no two poles are equal
_PAIR = 1.4
# per sampling interval, up to which fast poles are tried
_FASTEST = 0.45
_CANDIDATES = 16
# of the bandwidth, which the slowest mode must keep under the error
_KEPT = 0.5
_LARGEST_ERROR, _BISECTIONS = 0.3, 6


@dataclass(frozen=True)
class RobotError:
    """What is believed of the robot, in units of the truth.

    Attributes:
        mass: Mass of the links' masses and inertias.
        stiffness: Stiffness of the joint stiffnesses.
    """

    mass: float = 1.0
    stiffness: float = 1.0

    def __str__(self) -> str:
        """In words."""
        parts = {"masses": self.mass, "joint stiffnesses": self.stiffness}
        return " and ".join(
            f"{name} believed {100.0 * abs(factor - 1.0):.2g} % too "
            f"{'low' if factor < 1.0 else 'high'}"
            for name, factor in parts.items()
            if factor != 1.0
        )


@dataclass(frozen=True)
class SampledRobot:
    """A law on a robot at rest.

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
            error: What is believed of the robot.
        """
        A = self.loop.closed(gains, 1.0 / error.mass, 1.0 / error.stiffness)
        return modes(A, self.period).slowest

    def errors(self, size: float) -> Iterator[RobotError]:
        """Yield errors of one kind at a time.

        Args:
            size: Relative.
        """
        for factor in (1.0 - size, 1.0 + size):
            yield RobotError(mass=factor)
            if self.is_elastic:
                yield RobotError(stiffness=factor)

    def corners(self, size: float) -> Iterator[RobotError]:
        """Yield the errors of one kind at a time, and of both.

        Args:
            size: Relative.
        """
        yield from self.errors(size)
        if self.is_elastic:
            for mass in (1.0 - size, 1.0 + size):
                for stiffness in (1.0 - size, 1.0 + size):
                    yield RobotError(mass, stiffness)

    def unborne(self, gains: LoopGains, size: float) -> RobotError | None:
        """Return the error of one kind under which the loop grows fastest; None if it is stable.

        Args:
            gains: Gains of all coordinates.
            size: Relative.
        """
        worst = max(self.errors(size), key=lambda error: self.rate(gains, error))
        return worst if self.rate(gains, worst) > 0.0 else None

    def borne(self, gains: LoopGains, direction: RobotError) -> float:
        """Return how large a relative error in some direction is borne, up to 0.3.

        Args:
            gains: Gains of all coordinates.
            direction: The error of any size that tells what is wrong, and which way.
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
    """Return two slow poles and as many fast ones as a law has beyond [1/s].

    Args:
        bandwidth: Bandwidth of the convergence, positive [1/s].
        fast: The slower of the fast ones, positive [1/s].
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
    """Return the slowest fast pole under which an error of the model is borne [1/s].

    Borne means that all modes keep half of the smallest bandwidth with masses and stiffnesses wrong
    by the error, one and both at a time. If no pole does that, it is the one that comes nearest.

    Args:
        robot: Law and robot.
        gains: Gains of all coordinates for a fast pole.
        bandwidths: Bandwidths of the coordinates, positive [1/s].
        error: Relative.
    """
    slowest, fastest = max(bandwidths), max(_FASTEST / robot.period, 1.01 * max(bandwidths))
    rates = {}
    for fast in np.geomspace(slowest, fastest, _CANDIDATES):
        tried = gains(float(fast))
        rates[float(fast)] = max(robot.rate(tried, wrong) for wrong in robot.corners(error))
        if rates[float(fast)] <= -_KEPT * min(bandwidths):
            return float(fast)
    return min(rates, key=lambda fast: rates[fast])
