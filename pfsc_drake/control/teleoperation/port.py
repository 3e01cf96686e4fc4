"""Port of one side of a teleoperation: its force on the moved body, and its messages."""

import math
from typing import Any

import casadi as ca
import numpy as np
import scipy.linalg

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.control.teleoperation.coordinates import (
    LINEAR,
    TURNING,
    BodyCoordinates,
    PointCoordinates,
)
from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters, PortLimits
from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE, UNITS

SIDES = ("leader", "follower")
# s: time constant for sending a deferred wave, and time for which the tank supplies it
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
# continuation of the record with six axes
TURNING_RECORD = {name: _ROWS[name] for name in _TURNING}


class TeleoperationPort(Block):
    r"""Port of one side of a teleoperation: a force on a moved body, paid from an energy tank.

    Both sides use the same block. With x the coordinates of the moved body, see :mod:`coordinates`,
    and v their rates, ``coupling`` acts on each axis separately, with its own parameters for
    rotations::

        waves            F = sqrt(2b) a - b v,     out: O = sqrt(2b) x - A
        position_force   follower  F = K (x_o - x) + D (v_o - v),  out: x, F
                         leader    F = -F_o,                       out: x
        four_channel     F = K (x_o - x) + D (v_o - v) + c f_o,    out: x, f

    Waves are sent as their integrals A and O (Niemeyer and Slotine): the next message contains the
    content of a lost one, and at rest both positions agree without drift. The received signal, A or
    ``x_o``, passes two lags ``tau``, and its rate is the wave a, or ``v_o``::

        tau^2 A'' + 2 tau A' + A = A_arrived,   a = (A+ - A) / T

    Energy (Franken et al.): the tank receives the energy that the other side sent, and supplies the
    work of the force and the energy sent on. The work of a force, constant over a sample, is its
    product with the displacement, which is exact (Stramigioli et al.)::

        E = min(capacity, E- - F_k . (x_k+1 - x_k) + arrived) - sent

    A wave carries ``T |o|^2 / 2``; since ``a^2/2 - F v = o^2/2``, this is the remaining energy, and
    the tank level is constant apart from irregular arrivals. A wave that exceeds the available
    energy is sent later. The message reports the ``lack``: the energy missing to the initial
    content, or to the reserve where that is more. A side with more energy sends a share of the
    excess, so that both sides meet again. Couplings without waves always send such a share. A
    reserve remains after sending, and the force is limited so that it cannot empty the tank at the
    largest speed. So E is never negative, and both sides together output no more energy than their
    tanks contained at the start, for any delay or loss in the channel.

    Where E is below its initial content, damping ``-d_r v`` fills it.

    With six axes F is a force and a moment, and the tank pays for both; the moment is constant
    over the rotation of its sample.

    Ports:
        position (input): Position of the moved point in the follower's world [m], shape (3,).
        orientation (input, six axes): R by rows, shape (9,).
        message (input): Newest message from the other side, shape (15,), see :data:`FIELDS`;
            zero before the first one.
        felt (input, optional): Force measured at this side, for the other one [N, Nm], shape
            (axes,).
        grip (input, optional): Factor on the force, shape (1,); 1 if not connected.
        force (output): F, world axes [N, Nm], shape (axes,); it acts ``ticks_late`` ticks later.
        message (output): Message to the other side, shape (15,).
        record (output): See :data:`RECORD`: the force that acts from this tick on, x since the
            start, the energy in the tank, the total energy sent and received, the distance by which
            the transmitted position lags for lack of energy [m] (``owed``), and the realized share
            of the force and of the wave; with six axes :data:`TURNING_RECORD`, too.

    State:
        tank; ``sent`` and ``received`` [J]; ``arrival``, A or ``x_o`` after the lags, and its
        ``rate``; ``sent_wave``, the transmitted part of O; ``target``, O at the last tick; the
        states of the coordinates; ``velocity``; ``forces`` and ``history``: forces that are
        still to act, and their A, oldest last.

    Args:
        side: ``leader`` or ``follower``.
        coupling: Parameters of the coupling.
        limits: Limits of the port.
    """

    def __init__(self, side: str, coupling: CouplingParameters, limits: PortLimits) -> None:
        self._side, self._coupling, self._limits = side, coupling, limits
        self._waves = coupling.coupling == "waves"
        # J; a share of the excess is sent to the other side
        self._content = max(coupling.tank.initial, limits.reserve)
        self._lag_matrix = _lag_matrix(coupling.smoothing, limits.period)
        self._coordinates = PointCoordinates() if coupling.rotation is None else BodyCoordinates()
        axes = self._coordinates.axes
        count = axes * (1 + limits.ticks_late)
        self.inputs = self._coordinates.inputs | {
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
        sizes = {
            "arrival": axes,
            "rate": axes,
            "sent_wave": axes,
            "target": axes,
            "velocity": axes,
        }
        self.states = {"tank": 1, "sent": 1, "received": 1} | sizes | self._coordinates.states
        self.states |= {"forces": count, "history": count}
        self.inner = {f"{name}_after": size for name, size in self.states.items()}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"tank": self._coupling.tank.initial} | self._coordinates.initial(u)

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        coupling, T, axes = self._coupling, self._limits.period, self._coordinates.axes
        motion = self._coordinates.motion(x, u)
        fade = (
            1.0 - math.exp(-T / coupling.velocity_smoothing)
            if coupling.velocity_smoothing > 0.0
            else 1.0
        )
        velocity = x.velocity + fade * (motion.step / T - x.velocity)
        signal, energy = u.message[FIELDS["signal"]][:axes], u.message[FIELDS["energy"]]
        arrival, slope = ca.horzsplit(ca.horzcat(signal - x.arrival, x.rate) @ self._lag_matrix)
        arrival, rate = x.arrival + arrival, arrival / T
        tank = x.tank - ca.dot(x.forces[-axes:], motion.displacement) + energy - x.received
        tank = ca.fmin(tank, coupling.tank.capacity) if coupling.passive else tank
        target = coupling.per_axis("wave") * motion.coordinates - x.history[-axes:]
        sent_wave, sent, paid = self._send(x, target, tank, ca.fmax(0.0, u.message[FIELDS["lack"]]))
        left = tank - sent
        force = self._force(arrival - motion.coordinates, velocity, rate, tank)
        force = self._coordinates.wrench(motion.coordinates, force) + self._reflected_force(u)
        force, share = self._limit_force(x, u, force, left)
        felt = u.felt if u.felt is not None else ca.DM.zeros(axes)
        felt = force if coupling.coupling == "position_force" else felt
        output = sent_wave if self._waves else motion.coordinates
        forces, none = ca.vertcat(force, x.forces), ca.DM.zeros(6 - axes)
        lack = ca.fmax(0.0, self._content - left) if self._waves and coupling.passive else 0.0
        message = ca.vertcat(t + 1.0, output, none, felt, none, x.sent + sent, lack)
        acting, sent = forces[-2 * axes : -axes], x.sent + sent
        wave = coupling.per_axis("wave")
        record = ca.vertcat(
            acting[LINEAR], motion.coordinates[LINEAR], left, sent, energy,
            ca.norm_2((target - sent_wave)[LINEAR] / wave[LINEAR]) if self._waves else 0.0,
            ca.fmin(share, paid),
            acting[TURNING], motion.coordinates[TURNING],
        )  # fmt: skip
        states = {
            "tank": left, "sent": sent, "received": energy, "arrival": arrival, "rate": slope,
            "sent_wave": sent_wave, "target": target, "velocity": velocity,
            "forces": forces[:-axes], "history": ca.vertcat(arrival, x.history)[:-axes],
        } | motion.states  # fmt: skip
        outputs = {"force": force, "message": message, "record": record}
        return outputs | {f"{name}_after": value for name, value in states.items()}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {name: getattr(y, f"{name}_after") for name in self.states}

    def _force(self, apart: Any, velocity: Any, rate: Any, tank: Any) -> Any:
        """Return the coupling force on the coordinates, shape (axes,)."""
        coupling, force = self._coupling, ca.DM.zeros(self._coordinates.axes)
        if self._waves:
            force = coupling.per_axis("wave") * rate - coupling.per_axis("impedance") * velocity
        elif coupling.coupling == "four_channel" or self._side == "follower":
            force = coupling.per_axis("stiffness") * apart + coupling.per_axis("damping") * (
                rate - velocity
            )
        if coupling.passive:
            lack = ca.fmax(0.0, ca.fmin(1.0, 1.0 - tank / coupling.tank.initial))
            force -= coupling.per_axis("refill") * lack * velocity
        return force

    def _reflected_force(self, u: Values) -> Any:
        """Return the part of the other side's measured force that is reflected [N, Nm]."""
        coupling, felt = self._coupling, u.message[FIELDS["felt"]][: self._coordinates.axes]
        if coupling.coupling == "four_channel":
            return coupling.force_share * felt
        return -felt if coupling.coupling == "position_force" and self._side == "leader" else 0.0

    def _send(self, x: Values, target: Any, tank: Any, lack: Any) -> tuple[Any, Any, Any]:
        """Return the transmitted part of O, its energy [J], and the share of the wave.

        The wave of the last tick comes first, with the energy above the reserve; then the deferred
        wave, with part of the rest: the slower it is sent, the less energy it takes. Energy above
        the tank's initial content is sent to a side that lacks energy.
        """
        coupling, T, reserve = self._coupling, self._limits.period, self._limits.reserve
        if not self._waves:
            above = ca.fmax(0.0, tank - self._content)
            return (
                x.sent_wave,
                T * coupling.tank.share * above if coupling.passive else ca.DM(0.0),
                ca.DM(1.0),
            )
        wave = target - x.target
        if not coupling.passive:
            return target, ca.sumsqr(wave) / (2.0 * T), ca.DM(1.0)
        payable, size = 2.0 * T * ca.fmax(0.0, tank - reserve), ca.sumsqr(wave)
        share = where(size > payable, ca.sqrt(payable / size), 1.0)
        wave = share * wave
        owed = T / _REPAID * (x.target - x.sent_wave)
        rest = ca.fmax(0.0, tank - ca.sumsqr(wave) / (2.0 * T) - self._limits.pending_reserve)
        along, length = ca.dot(wave, owed), ca.sumsqr(owed)
        root = ca.sqrt(along**2 + length * 2.0 * T * T / _LASTS * rest)
        most = (root - along) / ca.fmax(length, _NOTHING)
        wave += ca.fmin(most, 1.0) * owed
        energy = ca.sumsqr(wave) / (2.0 * T)
        above = ca.fmax(0.0, tank - energy - self._content)
        shared = coupling.tank.share * ca.fmin(1.0, lack / self._content) * above
        return x.sent_wave + wave, energy + T * shared, share

    def _limit_force(self, x: Values, u: Values, force: Any, left: Any) -> tuple[Any, Any]:
        """Return the limited force [N, Nm], and its share of the coupling force."""
        limits, axes = self._limits, self._coordinates.axes
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
        """Return the force of equal power at the largest speeds [N]."""
        size = ca.norm_2(force[LINEAR])
        if self._coordinates.axes > 3:
            per_moment = self._limits.turning / self._limits.speed
            size += per_moment * ca.norm_2(force[TURNING])
        return size


def _share(size: Any, most: Any) -> Any:
    """Return the share of a size that is within a limit."""
    return where(size > most, most / size, 1.0)


def _lag_matrix(smoothing: float, period: float) -> ca.DM:
    """Return the matrix of the two lags, which maps error and rate to step and rate, shape (2, 2).

    ``[missing, rate] M = [step, rate]`` after a period with a constant target, exactly.

    Args:
        smoothing: ``tau`` [s]; 0 for no lag.
        period: Sampling time T [s].
    """
    if smoothing == 0.0:
        return ca.DM([[1.0, 0.0], [0.0, 0.0]])
    # derivative of [missing, rate]
    slope = np.array([[0.0, -1.0], [smoothing**-2, -2.0 / smoothing]])
    over = scipy.linalg.expm(period * slope)
    steps = np.array([1.0, 0.0]) - over[0]
    return ca.DM(np.column_stack([steps, over[1]]))
