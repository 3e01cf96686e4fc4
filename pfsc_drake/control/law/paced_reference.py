"""Fastest motion along a partly free path that can always stop before the end of its free part."""

from typing import Any

import casadi as ca
from scipy.linalg import expm

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.control.law.timed_reference import StreamLimits, allowed_speed, lags, speed_to_stop

_ROUNDING = 1e-9  # m


class PacedReference(Block):
    """Reference of the arc length that can stop at any sample before the end of the free path.

    A point p moves forward with a speed v that changes by ``A T`` at most from sample to sample,
    up to the largest one from which it can still stop at the end g of the free path, and slow
    down to ``w_j`` before the section j, ``s_j .. s_(j+1)``, of the path::

        v+ = min(V, v + A T, f(c), f(c_j + w_j^2 / (2 A)) of all j ahead, present w_j)
        f(c) = A (sqrt(T^2 + 2 c / A) - T),   c = g - p - T v / 2
        p+ = p + T (v + v+) / 2

    If it brakes from now on, it comes to rest at ``p + T v / 2 + v^2 / (2 A)``. As long as g does
    not come nearer, p never passes g. If g does, p brakes with A and passes g by ``overrun``, which
    is known in advance. A free path that is withdrawn one sample later must remain free up to
    ``stop``.

    The reference y follows p through r equal lags, as in
    :class:`~pfsc_drake.control.law.timed_reference.StreamedReference`: y is a mean of past p,
    and so are its rates. So y is never beyond p, nor faster than V, nor accelerated more than A,
    and has r continuous derivatives for any jumps of g. As the mean includes speeds before a
    section, p is slow from ``w_j (2 sqrt(r) + 1) / bandwidth`` before it on,
    ``c_j = s_j - w_j (2 sqrt(r) + 1) / bandwidth - p - T v / 2``, and until y has left it.

    Ports:
        goal (input): Arc length g of the end of the free path [m], shape (1,); NaN or infinity
            counts as the next possible stop.
        speed (input, optional): Largest speed from now on [m/s], shape (1,), limited to 0 .. V;
            NaN or infinity counts as 0.
        stretches (input, optional): Sections ``s_j``, increasing, shape (J + 1,) [m].
        stretch_speeds (input, optional): ``w_j``, shape (J,) [m/s].
        reference (output): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,)
            [m, m/s, ..]; transversal and rotational references are zero.
        motion (output): The same of the arc length alone, shape (r + 1,).
        stop (output): Farthest point of rest if it brakes from the next sample on [m], (1,).
        overrun (output): Largest overrun of g to come [m], shape (1,); zero as a rule.

    State:
        place: ``[p, v]`` [m, m/s]. filtered: Derivatives 0..r-1 of y, shape (r,).

    Args:
        limits: V, A and the bandwidth of the lags.
        order: r, of the highest derivative.
        num_outputs: m.
        period: Sampling time T [s].
        stretches: Number of sections J.
        start: Initial position at rest [m].
    """

    def __init__(
        self,
        limits: StreamLimits,
        order: int,
        num_outputs: int,
        period: float,
        *,
        stretches: int = 1,
        start: float = 0.0,
    ) -> None:
        self._limits, self._order, self._m, self._period = limits, order, num_outputs, period
        self._start = start
        self._early = (2.0 * order**0.5 + 1.0) / limits.bandwidth
        self._rates = lags(order, limits.bandwidth)
        self._step = ca.DM(expm(period * self._rates)[:-1])
        self.inputs = {
            "goal": Port(1, "m"),
            "speed": Port(1, "m/s", optional=True),
            "stretches": Port(stretches + 1, "m", optional=True),
            "stretch_speeds": Port(stretches, "m/s", optional=True),
        }
        self.outputs = {
            "reference": Port((order + 1) * num_outputs, "m, m/s, .."),
            "motion": Port(order + 1, "m, m/s, .."),
            "stop": Port(1, "m"),
            "overrun": Port(1, "m"),
        }
        self.states = {"place": 2, "filtered": order}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states, at rest; omitted states are zero."""
        rest = ca.DM.zeros(self._order - 1)
        return {
            "place": ca.vertcat(self._start, 0.0),
            "filtered": ca.vertcat(self._start, rest),
        }

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        top = ca.DM(self._rates[self._order - 1, :-1]).T @ ca.vertcat(x.filtered, x.place)
        eta = ca.vertcat(x.filtered, top)
        rest = ca.MX(self._order + 1, self._m - 1)
        stop, speed = self._stop(x), x.place[1]
        goal = where(is_finite(u.goal), u.goal, stop)
        A, T = self._limits.acceleration, self._period
        # a sample of acceleration lengthens the distance of the sample and the braking distance
        later = ca.fmax(stop, ca.fmin(goal, stop + 2.0 * T * speed + 1.5 * A * T**2))
        return {
            "reference": ca.vec(ca.horzcat(eta, ca.densify(rest)).T),
            "motion": eta,
            "stop": later,
            "overrun": ca.fmax(stop - goal, 0.0),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        goal = where(is_finite(u.goal), u.goal, self._stop(x))
        speed = self._speed(x, u, goal)
        acceleration = (speed - x.place[1]) / self._period
        after = self._step @ ca.vertcat(x.filtered, x.place, acceleration)
        position = after[self._order]
        # rounding must not exceed the goal
        position = where(position - goal < _ROUNDING, ca.fmin(position, goal), position)
        return {"place": ca.vertcat(position, speed), "filtered": after[: self._order]}

    def _stop(self, x: Values) -> Any:
        """Return the point of rest if p brakes from now on."""
        position, speed = ca.vertsplit(x.place)
        return position + self._period * speed / 2.0 + speed**2 / (2.0 * self._limits.acceleration)

    def _speed(self, x: Values, u: Values, goal: Any) -> Any:
        """Return ``v+``."""
        A, T = self._limits.acceleration, self._period
        fastest = allowed_speed(self._limits, u.speed)
        position, speed = ca.vertsplit(x.place)
        here = position + T * speed / 2.0
        speed_limit = ca.fmin(
            ca.fmin(fastest, speed + A * T), speed_to_stop(ca.fmax(goal - here, 0.0), A, T)
        )
        if u.stretches is not None and u.stretch_speeds is not None:
            slow, end = u.stretch_speeds, u.stretches[1:]
            begin = u.stretches[:-1] - self._early * slow
            ahead = ca.fmax(begin - here, 0.0) + slow**2 / (2.0 * A)
            allowed = where(begin > here, speed_to_stop(ahead, A, T), slow)
            allowed = where(end < x.filtered[0], A * T + fastest, allowed)
            speed_limit = ca.fmin(speed_limit, ca.mmin(allowed))
        return ca.fmax(speed_limit, ca.fmax(speed - A * T, 0.0))
