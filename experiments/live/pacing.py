"""Simulated time that goes as fast as a clock, or slower, and says so."""

import time
from collections import deque
from collections.abc import Callable

# how far simulated time may lag and still catch up [s]; beyond, it stays behind
_SLACK = 0.1
# over which the real-time factor is taken [s]
_WINDOW = 1.0
_MOMENT = 0.03  # s


class RealTimePace:
    """Lets simulated time wait for the clock, and never run after it.

    A lag of up to 0.1 s, as of a computer that was busy for a moment, is caught up. What lags more
    was simulated too slowly: then time goes on from there, slower than the clock, as
    :attr:`factor` tells.

    Args:
        clock: Tells the time [s].
        sleep: Waits [s].
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._origin = 0.0
        self._past: deque[tuple[float, float]] = deque()

    def restart(self, simulated: float) -> None:
        """Begin anew, after time has stood still.

        Args:
            simulated: Simulated time now [s].
        """
        now = self._clock()
        self._origin = now - simulated
        self._past = deque([(now, simulated)])

    def keep(self, simulated: float) -> None:
        """Wait until the clock has come to a simulated time, if it has not.

        Args:
            simulated: Simulated time now [s].
        """
        early = self._origin + simulated - self._clock()
        if early > 0.0:
            self._sleep(early)
        elif early < -_SLACK:
            self._origin -= early + _SLACK
        self._past.append((self._clock(), simulated))
        while len(self._past) > 2 and self._past[-1][0] - self._past[1][0] >= _WINDOW:
            self._past.popleft()

    def wait(self) -> None:
        """Let a moment pass in which simulated time stands still."""
        self._sleep(_MOMENT)

    @property
    def factor(self) -> float:
        """Simulated over real time during the last second."""
        (begin, first), (end, last) = self._past[0], self._past[-1]
        return (last - first) / (end - begin) if end > begin else 1.0
