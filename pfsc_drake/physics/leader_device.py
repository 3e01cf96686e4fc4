"""A hand-held device that leads a robot elsewhere: its handle, motors and encoders."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.rotations import matrix_of, rotation_of, rotation_vector, rows_of
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive


@dataclass
class WristParameters(Parameters):
    """How the handle of a device with six axes turns.

    Attributes:
        inertia: Of the handle and the hand that grips it, about any axis [kg m^2].
        damping: Viscous friction of an axis [Nm s/rad].
        friction: Coulomb friction of an axis [Nm].
        resolution: Of the encoders [rad]; 0 if they are perfect.
        torque_limit: Largest moment of the motors [Nm].
        largest_speed: Fastest that a hand turns it [rad/s].
    """

    inertia: Positive = 0.004
    damping: NotNegative = 0.005
    friction: NotNegative = 0.01
    resolution: NotNegative = 1e-4
    torque_limit: Positive = 3.0
    largest_speed: Positive = 6.0


@dataclass
class LeaderParameters(Parameters):
    """A hand-held device, with three axes or six.

    Attributes:
        mass: Of the handle [kg].
        damping: Viscous friction of an axis [N s/m].
        friction: Coulomb friction of an axis [N].
        resolution: Of the encoders, at the handle [m]; 0 if they are perfect.
        force_limit: Largest force of the motors [N].
        largest_speed: Fastest that a hand moves it [m/s].
        wrist: How it turns, where it has six axes.
    """

    mass: Positive = 0.35
    damping: NotNegative = 0.5
    friction: NotNegative = 0.3
    resolution: NotNegative = 1e-5
    force_limit: Positive = 30.0
    largest_speed: Positive = 2.0
    wrist: WristParameters = field(default_factory=WristParameters)


class LeaderDevice(Block):
    """A mass with friction, between a hand and motors.

    ``m v' = f_hand + f_motor - d v - f_c sgn(v)`` along each axis, forces held over a tick, by
    implicit steps::

        v+ = shrink(v + T f / m, T f_c / m) / (1 + T d / m),   x+ = x + T v+

    shrink taking off up to the second argument. So the hand's and the motors' work, force times
    displacement, is never less than what the kinetic energy gains.

    Ports:
        motor_force (input): On the handle [N], shape (3,).
        hand_wrench (input): Of the hand on it, shape (6,), of which the force counts [N].
        position (output): As the encoders tell, shape (3,) [m].
        state (output): Position and velocity as they are, shape (6,) [m, m/s].

    State:
        position, velocity: Zero at the start.

    Args:
        parameters: The device.
        period: Sampling time T [s].
    """

    def __init__(self, parameters: LeaderParameters, period: float) -> None:
        self._device, self._period = parameters, period
        self.inputs = {"motor_force": Port(3, "N"), "hand_wrench": Port(6, "N, Nm")}
        self.outputs = {"position": Port(3, "m"), "state": Port(6, "m, m/s")}
        self.states = {"position": 3, "velocity": 3}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        measured = _encoded(x.position, self._device.resolution)
        return {"position": measured, "state": ca.vertcat(x.position, x.velocity)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        device, T = self._device, self._period
        force = u.motor_force + u.hand_wrench[:3]
        velocity = _driven(x.velocity, force, T, device.mass, device.friction, device.damping)
        return {"position": x.position + T * velocity, "velocity": velocity}


class LeaderWrist(Block):
    """How the handle of a device with six axes turns, a body that is alike about all axes.

    ``J w' = m_hand + m_motor - d w - f_c sgn(w)`` about the world's axes, as
    :class:`LeaderDevice` moves, and ``R+ = exp(T [w+]) R``.

    Ports:
        motor_moment (input): On the handle [Nm], shape (3,).
        hand_wrench (input): Of the hand on it, shape (6,), of which the moment counts [Nm].
        orientation (output): As the encoders tell, R by rows, shape (9,).
        state (output): R by rows and angular velocity as they are, shape (12,) [1, rad/s].

    State:
        rows: R; velocity: w; not turned and at rest at the start.

    Args:
        parameters: The wrist.
        period: Sampling time T [s].
    """

    def __init__(self, parameters: WristParameters, period: float) -> None:
        self._wrist, self._period = parameters, period
        self.inputs = {"motor_moment": Port(3, "Nm"), "hand_wrench": Port(6, "N, Nm")}
        self.outputs = {"orientation": Port(9), "state": Port(12, "1, rad/s")}
        self.states = {"rows": 9, "velocity": 3}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"rows": rows_of(ca.DM.eye(3))}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        step, measured = self._wrist.resolution, x.rows
        if step > 0.0:
            turn = _encoded(rotation_vector(matrix_of(x.rows)), step)
            measured = rows_of(rotation_of(turn))
        return {"orientation": measured, "state": ca.vertcat(x.rows, x.velocity)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        wrist, T = self._wrist, self._period
        moment = u.motor_moment + u.hand_wrench[3:]
        velocity = _driven(x.velocity, moment, T, wrist.inertia, wrist.friction, wrist.damping)
        R = rotation_of(T * velocity) @ matrix_of(x.rows)
        return {"rows": rows_of(R), "velocity": velocity}


def _encoded(measured: Any, step: float) -> Any:
    """Return what encoders of a resolution tell; 0 if they are perfect."""
    return step * ca.floor(measured / step + 0.5) if step > 0.0 else measured


def _driven(
    velocity: Any, force: Any, period: float, mass: float, friction: float, damping: float
) -> Any:
    """Return velocities a tick later, shape (3,)."""
    force = where(all_finite(force), force, 0.0)
    driven = velocity + period / mass * force
    least = period / mass * friction
    slid = ca.sign(driven) * ca.fmax(0.0, ca.fabs(driven) - least)
    return slid / (1.0 + period * damping / mass)
