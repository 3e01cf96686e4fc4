"""Sensor noise, drawn in advance."""

import math

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.physics.force_torque_sensor import NOISE_TICKS

_BLOCK = NOISE_TICKS // 2  # ticks whose noise is drawn together
_ROUNDING = 1e-6  # of a period


class SensorNoise(LeafSystem):
    """White Gaussian noise of a sensor, which depends on seed and tick alone.

    It is not a block, because numpy draws it. While the noise of one half of the ticks is read, the
    noise of the other half exists already, so that the order of evaluation at a tick does not
    matter.

    Ports:
        noise (output): Noise of NOISE_TICKS ticks; tick k at ``k mod NOISE_TICKS``, shape
            (size NOISE_TICKS,).

    State:
        Discrete: the same.

    Args:
        deviation: Standard deviation of each component, shape (size,).
        seed: Seed of the noise.
        period: Sampling time [s].
    """

    def __init__(self, deviation: np.ndarray, seed: int, period: float) -> None:
        super().__init__()
        self._deviation, self._seed, self._span = np.asarray(deviation), seed, _BLOCK * period
        noise = self.DeclareDiscreteState(self._two_blocks(0))
        self.DeclareStateOutputPort("noise", noise)
        self.DeclareInitializationDiscreteUpdateEvent(self._draw)
        self.DeclarePeriodicDiscreteUpdateEvent(self._span, 0.0, self._draw)

    def _draw(self, context: Context, state: DiscreteValues) -> EventStatus:
        first = math.floor(context.get_time() / self._span + _ROUNDING / _BLOCK)
        state.set_value(self._two_blocks(first))
        return EventStatus.Succeeded()

    def _two_blocks(self, first: int) -> np.ndarray:
        blocks = [first, first + 1] if first % 2 == 0 else [first + 1, first]
        return np.concatenate([self._block(block) for block in blocks])

    def _block(self, block: int) -> np.ndarray:
        normal = np.random.default_rng((self._seed, block)).standard_normal
        values: np.ndarray = self._deviation * normal((_BLOCK, len(self._deviation)))
        return values.ravel()
