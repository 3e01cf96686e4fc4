"""Motion along a way of which only a part is free, at the highest pace that leaves room to stop."""

from typing import Any

import casadi as ca
from scipy.linalg import expm

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.control.law.timed_reference import StreamLimits, allowed_speed, lags, speed_to_stop

_ROUNDING = 1e-9  # m


class PacedReference(Block):
    """Reference of the arc length that can stop at every tick before the free way ends.

    A point p goes ahead with a speed v that changes by ``A T`` at most from tick to tick, to the
    largest from which it can still stop at the end g of the free way, and slow down to ``w_j``
    before the stretch j, ``s_j .. s_(j+1)``, of the way::

        v+ = min(V, v + A T, f(c), f(c_j + w_j^2 / (2 A)) of all j ahead, w_j of the one it is on)
        f(c) = A (sqrt(T^2 + 2 c / A) - T),   c = g - p - T v / 2
        p+ = p + T (v + v+) / 2

    Where it would rest if it braked from now on is ``p + T v / 2 + v^2 / (2 A)``. As long as g does
    not come nearer than that, p never passes g. If g does, p brakes with A and passes g by as much
    as that takes, which ``overrun`` tells before it happens. Whoever takes a free way back, a tick
    later, leaves it up to ``stop``.

    The reference y follows p through r equal lags, as in
    :class:`~pfsc_drake.control.law.timed_reference.StreamedReference`: y is a mean of where p has
    been, and so are its rates. So y is never beyond p, nor faster than V, nor accelerated more than
    A, and has r continuous derivatives however g jumps. As the mean remembers speeds from before a
    stretch, p is slow from ``w_j (2 sqrt(r) + 1) / bandwidth`` before it on,
    ``c_j = s_j - w_j (2 sqrt(r) + 1) / bandwidth - p - T v / 2``, and until y has left it.

    Ports:
        goal (input): Arc length g at which the free way ends [m], shape (1,); what is no number
            counts as where it can stop.
        speed (input, optional): Largest speed from now on [m/s], shape (1,), limited to 0 .. V;
            what is no number counts as 0.
        stretches (input, optional): ``s_j``, increasing, shape (J + 1,) [m].
        stretch_speeds (input, optional): ``w_j``, shape (J,) [m/s].
        reference (output): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,)
            [m, m/s, ..]; transversal and rotational references are zero.
        motion (output): The same of the arc length alone, shape (r + 1,).
        stop (output): Where it would rest at most if it braked from the next tick on [m], (1,).
        overrun (output): By how much it will pass g at most [m], shape (1,); zero as a rule.

    State:
        place: ``[p, v]`` [m, m/s]. filtered: Derivatives 0..r-1 of y, shape (r,).

    Args:
        limits: V, A and the bandwidth of the lags.
        order: r, of the highest derivative.
        num_outputs: m.
        period: Sampling time T [s].
        stretches: J.
        start: Where it rests at first [m].
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
        """Return what is remembered at the start; what is left out is zero; at rest."""
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
        # a tick of acceleration takes both the way of that tick and more to brake
        later = ca.fmax(stop, ca.fmin(goal, stop + 2.0 * T * speed + 1.5 * A * T**2))
        return {
            "reference": ca.vec(ca.horzcat(eta, ca.densify(rest)).T),
            "motion": eta,
            "stop": later,
            "overrun": ca.fmax(stop - goal, 0.0),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        goal = where(is_finite(u.goal), u.goal, self._stop(x))
        speed = self._speed(x, u, goal)
        acceleration = (speed - x.place[1]) / self._period
        after = self._step @ ca.vertcat(x.filtered, x.place, acceleration)
        place = after[self._order]
        # rounding must not lead beyond it
        place = where(place - goal < _ROUNDING, ca.fmin(place, goal), place)
        return {"place": ca.vertcat(place, speed), "filtered": after[: self._order]}

    def _stop(self, x: Values) -> Any:
        """Return where p would rest if it braked from now on."""
        place, speed = ca.vertsplit(x.place)
        return place + self._period * speed / 2.0 + speed**2 / (2.0 * self._limits.acceleration)

    def _speed(self, x: Values, u: Values, goal: Any) -> Any:
        """Return ``v+``."""
        A, T = self._limits.acceleration, self._period
        fastest = allowed_speed(self._limits, u.speed)
        place, speed = ca.vertsplit(x.place)
        here = place + T * speed / 2.0
        wanted = ca.fmin(
            ca.fmin(fastest, speed + A * T), speed_to_stop(ca.fmax(goal - here, 0.0), A, T)
        )
        if u.stretches is not None and u.stretch_speeds is not None:
            slow, end = u.stretch_speeds, u.stretches[1:]
            begin = u.stretches[:-1] - self._early * slow
            ahead = ca.fmax(begin - here, 0.0) + slow**2 / (2.0 * A)
            allowed = where(begin > here, speed_to_stop(ahead, A, T), slow)
            allowed = where(end < x.filtered[0], A * T + fastest, allowed)
            wanted = ca.fmin(wanted, ca.mmin(allowed))
        return ca.fmax(wanted, ca.fmax(speed - A * T, 0.0))
