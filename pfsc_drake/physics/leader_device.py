"""Leader device of teleoperation: handle, motors and encoders."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.rotations import matrix_of, rotation_of, rotation_vector, rows_of
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive


@dataclass
class WristParameters(Parameters):
    """Rotation of the handle of a device with six axes.

    Attributes:
        inertia: Inertia of the handle and the operator's hand about any axis [kg m^2].
        damping: Viscous friction of an axis [Nm s/rad].
        friction: Coulomb friction of an axis [Nm].
        resolution: Resolution of the encoders [rad]; 0 if exact.
        torque_limit: Largest moment of the motors [Nm].
        largest_speed: Largest angular velocity by the operator [rad/s].
    """

    inertia: Positive = 0.004
    damping: NotNegative = 0.005
    friction: NotNegative = 0.01
    resolution: NotNegative = 1e-4
    torque_limit: Positive = 3.0
    largest_speed: Positive = 6.0


@dataclass
class LeaderParameters(Parameters):
    """Leader device with three or six axes.

    Attributes:
        mass: Mass of the handle [kg].
        damping: Viscous friction of an axis [N s/m].
        friction: Coulomb friction of an axis [N].
        resolution: Resolution of the encoders at the handle [m]; 0 if exact.
        force_limit: Largest force of the motors [N].
        largest_speed: Largest speed by the operator [m/s].
        wrist: Rotation of the handle, with six axes.
    """

    mass: Positive = 0.35
    damping: NotNegative = 0.5
    friction: NotNegative = 0.3
    resolution: NotNegative = 1e-5
    force_limit: Positive = 30.0
    largest_speed: Positive = 2.0
    wrist: WristParameters = field(default_factory=WristParameters)


class LeaderDevice(Block):
    """A mass with friction under the forces of operator and motors.

    ``m v' = f_hand + f_motor - d v - f_c sgn(v)`` along each axis, with constant forces over a
    tick, by implicit steps::

        v+ = shrink(v + T f / m, T f_c / m) / (1 + T d / m),   x+ = x + T v+

    where shrink reduces the magnitude by up to the second argument. So the work of operator and
    motors, force times displacement, is never less than the increase of kinetic energy.

    Ports:
        motor_force (input): Force of the motors on the handle [N], shape (3,).
        hand_wrench (input): Wrench of the operator on it, shape (6,); its force is used [N].
        position (output): Measured position, shape (3,) [m].
        state (output): Actual position and velocity, shape (6,) [m, m/s].

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
        measured = _quantize(x.position, self._device.resolution)
        return {"position": measured, "state": ca.vertcat(x.position, x.velocity)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        device, T = self._device, self._period
        force = u.motor_force + u.hand_wrench[:3]
        velocity = _next_velocity(
            x.velocity, force, T, device.mass, device.friction, device.damping
        )
        return {"position": x.position + T * velocity, "velocity": velocity}


class LeaderWrist(Block):
    """Rotation of the handle of a device with six axes, with equal inertia about all axes.

    ``J w' = m_hand + m_motor - d w - f_c sgn(w)`` about the world's axes, integrated as in
    :class:`LeaderDevice`, and ``R+ = exp(T [w+]) R``.

    Ports:
        motor_moment (input): Moment of the motors on the handle [Nm], shape (3,).
        hand_wrench (input): Wrench of the operator on it, shape (6,); its moment is used [Nm].
        orientation (output): Measured R by rows, shape (9,).
        state (output): Actual R by rows and angular velocity, shape (12,) [1, rad/s].

    State:
        rows: R; velocity: w; initially the identity, at rest.

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
        """Return the initial states; omitted ones are zero."""
        return {"rows": rows_of(ca.DM.eye(3))}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        step, measured = self._wrist.resolution, x.rows
        if step > 0.0:
            turn = _quantize(rotation_vector(matrix_of(x.rows)), step)
            measured = rows_of(rotation_of(turn))
        return {"orientation": measured, "state": ca.vertcat(x.rows, x.velocity)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        wrist, T = self._wrist, self._period
        moment = u.motor_moment + u.hand_wrench[3:]
        velocity = _next_velocity(
            x.velocity, moment, T, wrist.inertia, wrist.friction, wrist.damping
        )
        R = rotation_of(T * velocity) @ matrix_of(x.rows)
        return {"rows": rows_of(R), "velocity": velocity}


def _quantize(measured: Any, step: float) -> Any:
    """Return positions quantized to a resolution; exact if it is 0."""
    return step * ca.floor(measured / step + 0.5) if step > 0.0 else measured


def _next_velocity(
    velocity: Any, force: Any, period: float, mass: float, friction: float, damping: float
) -> Any:
    """Return velocities one tick later, shape (3,)."""
    force = where(all_finite(force), force, 0.0)
    driven = velocity + period / mass * force
    least = period / mass * friction
    slid = ca.sign(driven) * ca.fmax(0.0, ca.fabs(driven) - least)
    return slid / (1.0 + period * damping / mass)
