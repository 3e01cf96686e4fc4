"""Oscillating virtual fixtures: transversal references that oscillate with time (5.1), (5.2)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.control.law.reference import Transition
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive, Range


@dataclass
class Swing(Parameters):
    """Oscillation of a transversal reference, ``A s(t) sin(2 pi f (t - begin))``.

    So the manifold moves along its own normals, like a circle of varying radius,
    ``xi_p = e' Delta sigma_t(t)``.

    Attributes:
        coordinate: Number of the transversal coordinate, from 1.
        amplitude: A [m].
        frequency: f [Hz].
        begin: Begin of the oscillation [s].
        ramp: Time in which s rises from 0 to 1, with four continuous derivatives [s].
    """

    coordinate: Annotated[int, Range(1, 2)] = 1
    amplitude: Annotated[float, Range(0.0, 1.0, "m", open=True)] = 0.01
    frequency: Annotated[float, Range(0.0, 100.0, "Hz", open=True)] = 0.5
    begin: NotNegative = 0.5
    ramp: Positive = 0.5


class OscillatingReference:
    """Sum of several oscillations with its derivatives.

    Args:
        swings: The oscillations.
        first: Row of the first transversal coordinate among the outputs.
        transversal: Number of transversal coordinates.
        outputs: Number m of outputs.
        order: Highest derivative r, at most 4.

    Raises:
        InputError: If an oscillation has a coordinate that does not exist.
    """

    def __init__(
        self, swings: Sequence[Swing], first: int, transversal: int, outputs: int, order: int
    ) -> None:
        for i, swing in enumerate(swings):
            if swing.coordinate > transversal:
                raise InputError(
                    f"swings[{i}]: coordinate = {swing.coordinate}; there "
                    f"{'is 1' if transversal == 1 else f'are {transversal}'}"
                )
        self._swings, self._first = tuple(swings), first
        self._rises = [Transition(swing.ramp, order) for swing in swings]
        self._outputs, self._order = outputs, order

    def at(self, time: Any) -> Any:
        """Return derivatives 0..r by rows, shape (r + 1, m) [m, m/s, ..].

        Args:
            time: Time [s], number or expression.
        """
        columns = [ca.DM.zeros(self._order + 1)] * self._outputs
        for swing, rise in zip(self._swings, self._rises, strict=True):
            since = ca.fmax(time - swing.begin, 0.0)
            omega = 2.0 * math.pi * swing.frequency
            left = ca.vertsplit(rise.at(since))
            s = [1.0 - left[0], *(-rate for rate in left[1:])]
            sine = [
                omega**k * ca.sin(omega * since + k * math.pi / 2.0) for k in range(self._order + 1)
            ]
            product = [  # Leibniz
                sum(math.comb(k, i) * s[i] * sine[k - i] for i in range(k + 1))
                for k in range(self._order + 1)
            ]
            column = self._first + swing.coordinate - 1
            columns[column] = columns[column] + swing.amplitude * ca.vertcat(*product)
        return ca.horzcat(*columns)


class OscillatingManifold(Block):
    """Reference with oscillations.

    Ports:
        desired_reference (input): Derivatives 0..r of m outputs by rows, shape ((r + 1) m,).
        reference (output): The same with the oscillations, shape ((r + 1) m,).

    Args:
        swings: The oscillations.
        size: (r + 1) m.
        period: Sampling time [s].
    """

    def __init__(self, swings: OscillatingReference, size: int, period: float) -> None:
        self._swings, self._period = swings, period
        self.inputs, self.states = {"desired_reference": Port(size)}, {}
        self.outputs = {"reference": Port(size)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        swings = self._swings.at(t * self._period)
        return {"reference": u.desired_reference + ca.vec(swings.T)}


_SAMPLES = 2001


class OscillatingMotion:
    """Motion ``A s(t) sin(2 pi f (t - begin))`` over a region's clock, see :class:`Swing`.

    Args:
        amplitude: A [m], or [rad].
        frequency: f [Hz].
        begin: Begin of the oscillation [s].
        ramp: Time in which s rises from 0 to 1 [s].

    Attributes:
        largest_rate: A bound of its absolute rate [m/s], or [rad/s].

    Raises:
        InputError: If a number is out of range, see :class:`Swing`.
    """

    def __init__(
        self, amplitude: float, frequency: float, *, begin: float = 0.0, ramp: float = 0.5
    ) -> None:
        unit = Swing(amplitude=1.0, frequency=frequency, begin=begin, ramp=ramp)
        self._unit = OscillatingReference([unit], first=0, transversal=1, outputs=1, order=0)
        self._amplitude = amplitude
        clock = ca.SX.sym("clock")
        moving = OscillatingReference([unit], first=0, transversal=1, outputs=1, order=2).at(clock)
        times, step = np.linspace(begin, begin + ramp, _SAMPLES, retstep=True)
        _, rates, bends = np.abs(ca.Function("moving", [clock], [moving])(times[None]).full())
        # between two samples it changes by half a step at most
        rising = float(rates.max() + 0.5 * step * bends.max())
        self.largest_rate = abs(amplitude) * max(2.0 * math.pi * frequency, rising)

    def at(self, clock: ca.MX) -> ca.MX:
        """Value at a time of the clock [s], m or rad, as an expression."""
        return self._amplitude * self._unit.at(clock)
