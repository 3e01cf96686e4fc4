"""One side of a teleoperation: what it does to what it moves, and what it tells the other side."""

import math
from typing import Any

import casadi as ca
import numpy as np
import scipy.linalg

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.control.teleoperation.coordinates import LINEAR, TURNING, MovedBody, MovedPoint
from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters, PortLimits
from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE, UNITS

SIDES = ("leader", "follower")
# s: within which a wave that could not be paid is sent later, and for which a tank lasts for that
_REPAID, _LASTS = 0.1, 0.5
_NOTHING = 1e-30  # J s
_RECORD = {"force": 3, "position": 3, "tank": 1, "sent": 1, "received": 1, "owed": 1, "share": 1}
_TURNING = {"moment": 3, "turn": 3}
_ENDS = np.cumsum([*_RECORD.values(), *_TURNING.values()]).tolist()
_ROWS = {
    name: slice(end - size, end)
    for (name, size), end in zip((_RECORD | _TURNING).items(), _ENDS, strict=True)
}
RECORD = {name: _ROWS[name] for name in _RECORD}
# with six axes the record goes on
TURNING_RECORD = {name: _ROWS[name] for name in _TURNING}


class TeleoperationPort(Block):
    r"""A force on what a side moves, from what the other side tells, paid from a tank.

    Both sides are alike. With x the coordinates of what is moved, see :mod:`coordinates`, and v
    their rates, by ``coupling``, each axis for itself, turns with numbers of their own::

        waves            F = sqrt(2b) a - b v,     out: O = sqrt(2b) x - A
        position_force   follower  F = K (x_o - x) + D (v_o - v),  out: x, F
                         leader    F = -F_o,                       out: x
        four_channel     F = K (x_o - x) + D (v_o - v) + c f_o,    out: x, f

    Waves go as their integrals A and O (Niemeyer and Slotine): what a message lost is in the next
    one, and where both sides rest, both positions are the same, drift or not. What arrives, A or
    ``x_o``, is taken over by two lags ``tau``, and its rate is the wave a, or ``v_o``::

        tau^2 A'' + 2 tau A' + A = A_arrived,   a = (A+ - A) / T

    Energy (Franken et al.): the tank gets what the other side gave away, and pays the work of the
    force and what is sent on. Work is counted as of a held force over the displacement of its tick,
    which is exact (Stramigioli et al.)::

        E = min(capacity, E- - F_k . (x_k+1 - x_k) + arrived) - sent

    A wave takes ``T |o|^2 / 2`` with it; as ``a^2/2 - F v = o^2/2``, that is what is left, and the
    tank stays as it is but for what arrives unevenly. What cannot be paid is sent later, and the
    other side is told of the ``lack``, what is missing to the initial content, or to the reserve
    where that is more: a side that has more sends a share of it, so that both come to meet.
    Couplings without waves always send such a share. What is sent leaves a reserve, and a
    force is given that could not empty what is left at the largest speed. So E never falls below
    zero, and both sides together give no more than their tanks held at the start, whatever the
    channel delays or loses.

    Where E is below its initial content, damping ``-d_r v`` fills it.

    With six axes F is a force and a moment, of which the tank pays for both; its work is that
    of a held moment over the turn of its tick.

    Ports:
        position (input): Of what is moved, in the world of the follower [m], shape (3,).
        orientation (input, six axes): R by rows, shape (9,).
        message (input): What arrived last from the other side, shape (15,), see :data:`FIELDS`;
            zero if nothing did.
        felt (input, optional): Force that the side feels, for the other one [N, Nm], shape (axes,).
        grip (input, optional): Share of the force that is given, shape (1,); 1 if not connected.
        force (output): F, world axes [N, Nm], shape (axes,); it acts ``ticks_late`` ticks later.
        message (output): For the other side, shape (15,).
        record (output): See :data:`RECORD`: the force that acts from this tick on, x since the
            start, what is left in the tank, all that was sent and received, how far x is from what
        the other side could be told for want of energy [m] (``owed``), and the share of the
            force and of the wave that could be paid; with six axes :data:`TURNING_RECORD`, too.

    State:
        tank; ``sent`` and ``received`` [J]; ``heard``, A or ``x_o``, and its ``rate``; ``given``,
        what was sent of O; ``aim``, O at the last tick; what the coordinates remember;
        ``velocity``; ``forces`` and ``taken``: forces that are to act, and A that they are of,
        oldest last.

    Args:
        side: ``leader`` or ``follower``.
        coupling: How it is coupled.
        limits: What it may count on.
    """

    def __init__(self, side: str, coupling: CouplingParameters, limits: PortLimits) -> None:
        self._side, self._coupling, self._limits = side, coupling, limits
        self._waves = coupling.coupling == "waves"
        # J; of what is above, a share is sent on
        self._content = max(coupling.tank.initial, limits.reserve)
        self._takeover = _takeover(coupling.smoothing, limits.period)
        self._of = MovedPoint() if coupling.rotation is None else MovedBody()
        axes = self._of.axes
        count = axes * (1 + limits.ticks_late)
        self.inputs = self._of.inputs | {
            "message": Port(MESSAGE, UNITS),
            "felt": Port(axes, "N, Nm", optional=True),
            "grip": Port(1, optional=True),
        }
        self.outputs = {
            "force": Port(axes, "N, Nm"),
            "message": Port(MESSAGE, UNITS),
            "record": Port(
                _ENDS[-1] if axes > 3 else RECORD["share"].stop, "N, m, J, m, 1, Nm, rad"
            ),
        }
        sizes = {"heard": axes, "rate": axes, "given": axes, "aim": axes, "velocity": axes}
        self.states = {"tank": 1, "sent": 1, "received": 1} | sizes | self._of.states
        self.states |= {"forces": count, "taken": count}
        self.inner = {f"{name}_after": size for name, size in self.states.items()}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"tank": self._coupling.tank.initial} | self._of.initial(u)

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        way, T, axes = self._coupling, self._limits.period, self._of.axes
        moved = self._of.moved(x, u)
        fade = 1.0 - math.exp(-T / way.velocity_smoothing) if way.velocity_smoothing > 0.0 else 1.0
        velocity = x.velocity + fade * (moved.step / T - x.velocity)
        signal, energy = u.message[FIELDS["signal"]][:axes], u.message[FIELDS["energy"]]
        heard, slope = ca.horzsplit(ca.horzcat(signal - x.heard, x.rate) @ self._takeover)
        heard, rate = x.heard + heard, heard / T
        tank = x.tank - ca.dot(x.forces[-axes:], moved.way) + energy - x.received
        tank = ca.fmin(tank, way.tank.capacity) if way.passive else tank
        aim = way.per_axis("wave") * moved.there - x.taken[-axes:]
        given, sent, paid = self._send(x, aim, tank, ca.fmax(0.0, u.message[FIELDS["lack"]]))
        left = tank - sent
        force = self._force(heard - moved.there, velocity, rate, tank)
        force = self._of.wrench(moved.there, force) + self._told_force(u)
        force, share = self._affordable(x, u, force, left)
        felt = u.felt if u.felt is not None else ca.DM.zeros(axes)
        felt = force if way.coupling == "position_force" else felt
        told = given if self._waves else moved.there
        forces, none = ca.vertcat(force, x.forces), ca.DM.zeros(6 - axes)
        lack = ca.fmax(0.0, self._content - left) if self._waves and way.passive else 0.0
        message = ca.vertcat(t + 1.0, told, none, felt, none, x.sent + sent, lack)
        acting, sent = forces[-2 * axes : -axes], x.sent + sent
        record = ca.vertcat(
            acting[LINEAR], moved.there[LINEAR], left, sent, energy,
            ca.norm_2((aim - given)[LINEAR] / way.per_axis("wave")[LINEAR]) if self._waves else 0.0,
            ca.fmin(share, paid),
            acting[TURNING], moved.there[TURNING],
        )  # fmt: skip
        after = {
            "tank": left, "sent": sent, "received": energy, "heard": heard, "rate": slope,
            "given": given, "aim": aim, "velocity": velocity,
            "forces": forces[:-axes], "taken": ca.vertcat(heard, x.taken)[:-axes],
        } | moved.after  # fmt: skip
        outputs = {"force": force, "message": message, "record": record}
        return outputs | {f"{name}_after": value for name, value in after.items()}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {name: getattr(y, f"{name}_after") for name in self.states}

    def _force(self, apart: Any, velocity: Any, rate: Any, tank: Any) -> Any:
        """Return the force on the coordinates that the coupling wants, shape (axes,)."""
        way, force = self._coupling, ca.DM.zeros(self._of.axes)
        if self._waves:
            force = way.per_axis("wave") * rate - way.per_axis("impedance") * velocity
        elif way.coupling == "four_channel" or self._side == "follower":
            force = way.per_axis("stiffness") * apart + way.per_axis("damping") * (rate - velocity)
        if way.passive:
            lack = ca.fmax(0.0, ca.fmin(1.0, 1.0 - tank / way.tank.initial))
            force -= way.per_axis("refill") * lack * velocity
        return force

    def _told_force(self, u: Values) -> Any:
        """Return the force that the other side feels, as far as the coupling gives it [N, Nm]."""
        way, felt = self._coupling, u.message[FIELDS["felt"]][: self._of.axes]
        if way.coupling == "four_channel":
            return way.force_share * felt
        return -felt if way.coupling == "position_force" and self._side == "leader" else 0.0

    def _send(self, x: Values, aim: Any, tank: Any, lack: Any) -> tuple[Any, Any, Any]:
        """Return what was sent of O by now, energy that goes with it [J], and the share of it.

        The wave of the last tick comes first, with what is above the reserve; then what has not
        been sent before, by a part of the rest that lasts: the slower, the less energy it takes.
        What is above the tank's initial content goes to a side that lacks energy.
        """
        way, T, reserve = self._coupling, self._limits.period, self._limits.reserve
        if not self._waves:
            above = ca.fmax(0.0, tank - self._content)
            return x.given, T * way.tank.share * above if way.passive else ca.DM(0.0), ca.DM(1.0)
        wave = aim - x.aim
        if not way.passive:
            return aim, ca.sumsqr(wave) / (2.0 * T), ca.DM(1.0)
        payable, size = 2.0 * T * ca.fmax(0.0, tank - reserve), ca.sumsqr(wave)
        share = where(size > payable, ca.sqrt(payable / size), 1.0)
        wave = share * wave
        owed = T / _REPAID * (x.aim - x.given)
        rest = ca.fmax(0.0, tank - ca.sumsqr(wave) / (2.0 * T) - self._limits.pledged)
        along, length = ca.dot(wave, owed), ca.sumsqr(owed)
        root = ca.sqrt(along**2 + length * 2.0 * T * T / _LASTS * rest)
        most = (root - along) / ca.fmax(length, _NOTHING)
        wave += ca.fmin(most, 1.0) * owed
        energy = ca.sumsqr(wave) / (2.0 * T)
        above = ca.fmax(0.0, tank - energy - self._content)
        shared = way.tank.share * ca.fmin(1.0, lack / self._content) * above
        return x.given + wave, energy + T * shared, share

    def _affordable(self, x: Values, u: Values, force: Any, left: Any) -> tuple[Any, Any]:
        """Return the force that is given [N, Nm], and its share of what is wanted."""
        limits, axes = self._limits, self._of.axes
        share = _share(ca.norm_2(force[LINEAR]), limits.force)
        if axes > 3:
            share = ca.fmin(share, _share(ca.norm_2(force[TURNING]), limits.moment))
        if self._coupling.passive:
            pending = ca.fmax(0.0, left) / (limits.speed * limits.period)
            for k in range(limits.ticks_late):
                pending -= self._costs(x.forces[axes * k : axes * (k + 1)])
            share = ca.fmin(share, _share(self._costs(force), ca.fmax(0.0, pending)))
        grip = ca.DM(1.0) if u.grip is None else ca.fmax(0.0, ca.fmin(1.0, u.grip))
        return grip * share * force, share

    def _costs(self, force: Any) -> Any:
        """Return the force that takes as much energy at the largest speeds [N]."""
        size = ca.norm_2(force[LINEAR])
        if self._of.axes > 3:
            per_moment = self._limits.turning / self._limits.speed
            size += per_moment * ca.norm_2(force[TURNING])
        return size


def _share(size: Any, most: Any) -> Any:
    """Return what of a size is within a limit."""
    return where(size > most, most / size, 1.0)


def _takeover(smoothing: float, period: float) -> ca.DM:
    """Return how what is missing, and the rate, become steps and rates, shape (2, 2).

    ``[missing, rate] M = [step, rate]`` after a period in which the aim stays, exactly.

    Args:
        smoothing: ``tau`` [s]; 0 takes all over at once.
        period: T [s].
    """
    if smoothing == 0.0:
        return ca.DM([[1.0, 0.0], [0.0, 0.0]])
    # of [missing, rate]
    slope = np.array([[0.0, -1.0], [smoothing**-2, -2.0 / smoothing]])
    over = scipy.linalg.expm(period * slope)
    steps = np.array([1.0, 0.0]) - over[0]
    return ca.DM(np.column_stack([steps, over[1]]))
