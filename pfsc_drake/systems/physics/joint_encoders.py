"""Position encoders of the joints and of the motors."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# part of a period by which a tick may come early
_ROUNDING = 1e-6


@dataclass
class EncoderOptions:
    """What the encoders do to the true joint state.

    Increments are counted on the joint side: per revolution of a revolute joint, per metre
    of a slide. An encoder on the motor shaft has its own number times the gear ratio.

    Attributes:
        link_increments: Of the encoders of ``q_J``: none (exact), one number for all joints,
            or one per joint; 0 is exact.
        motor_increments: Of the encoders of ``q_M``, likewise.
        difference_quotient: Whether velocities are difference quotients of the measured
            positions, else the true ones.
        filter_time: Time constant of a first-order filter behind the difference quotient
            [s]; 0 for none.
    """

    link_increments: list[float] = field(default_factory=list)
    motor_increments: list[float] = field(default_factory=list)
    difference_quotient: bool = False
    filter_time: float = 0.0


class JointEncoders(LeafSystem):
    """Measures the joint state by encoders, without delay.

    A position is ``r round(q / r)`` with the resolution ``r = 2 pi / increments`` [rad] or
    ``1 / increments`` [m]. With difference quotients the velocity is, at the ticks::

        v_k = v_{k-1} + (1 - exp(-T / filter_time)) ((q_k - q_{k-1}) / T - v_{k-1})

    (without a filter ``(q_k - q_{k-1}) / T``) and is held in between; at the start, it is the
    true one. Whoever reads at a tick gets the value of this tick. Without any option
    the output is the input, to the last bit.

    Ports:
        joint_state (input): True ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        joint_state (output): The same as measured, shape (4N,).

    State:
        With difference quotients only, discrete: ``[q_J, v_J, q_M, v_M]`` as measured at
        the last tick and its time [s], shape (4N + 1,).

    Args:
        robot: The robot, N joints.
        options: What the encoders do.
        period: Sampling time T of the difference quotient [s]; that of the fastest reader.

    Raises:
        InputError: If an option or the period is out of range.
    """

    def __init__(self, robot: RobotModel, options: EncoderOptions, period: float) -> None:
        super().__init__()
        self._period, n = period, robot.dimension
        if not 0.0 < period < np.inf:
            raise InputError(f"encoders: period = {period!r} s; must be positive and finite")
        if not 0.0 <= options.filter_time < np.inf:
            raise InputError(
                f"encoders: filter_time = {options.filter_time!r} s; must be finite, not negative"
            )
        resolution = np.zeros((2, 2, n))
        resolution[:, 0] = encoder_resolution(robot, options)
        self._counted = np.flatnonzero(resolution)
        self._resolution, self._shape = resolution.ravel()[self._counted], resolution.shape
        time_constant = options.filter_time
        self._weight = 1.0 - np.exp(-period / time_constant) if time_constant else 1.0
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        sources = {self._joint_state.ticket()}
        if options.difference_quotient:
            memory = self.DeclareDiscreteState(4 * n + 1)
            sources |= {self.discrete_state_ticket(memory), self.time_ticket()}
            self.DeclareInitializationDiscreteUpdateEvent(self._start)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)
        self._has_memory = options.difference_quotient
        self._measured = self.DeclareVectorOutputPort(
            "joint_state", 4 * n, self._calc_measured, prerequisites_of_calc=sources
        )

    def _quantize(self, state: np.ndarray) -> np.ndarray:
        measured = state.copy()
        r = self._resolution
        measured[self._counted] = r * np.rint(state[self._counted] / r)
        return measured

    def _calc_measured(self, context: Context, output: BasicVector) -> None:
        measured = self._quantize(self._joint_state.Eval(context))
        if self._has_memory:
            memory = context.get_discrete_state_vector().value()
            now, last = measured.reshape(self._shape), memory[:-1].reshape(self._shape)
            velocity = last[:, 1]
            if context.get_time() - memory.item(-1) > self._period * (1.0 - _ROUNDING):
                quotient = (now[:, 0] - last[:, 0]) / self._period
                velocity = velocity + self._weight * (quotient - velocity)
            now[:, 1] = velocity
        output.SetFromVector(measured)

    def _start(self, context: Context, state: DiscreteValues) -> EventStatus:
        measured = self._quantize(self._joint_state.Eval(context))
        state.set_value(np.append(measured, context.get_time()))
        return EventStatus.Succeeded()

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(np.append(self._measured.Eval(context), context.get_time()))


def encoder_resolution(robot: RobotModel, options: EncoderOptions) -> np.ndarray:
    """Return the steps of the measured positions of links and motors, shape (2, N) [rad or m].

    Args:
        robot: The robot, N joints.
        options: What the encoders do.

    Raises:
        InputError: If an option is out of range.
    """
    n = robot.dimension
    per_unit, steps = np.where(robot.gather("is_revolute"), 2.0 * np.pi, 1.0), np.zeros((2, n))
    for step, name in zip(steps, ("link_increments", "motor_increments"), strict=True):
        increments = _increments(name, getattr(options, name), n)
        coarse = increments > 0.0
        step[coarse] = per_unit[coarse] / increments[coarse]
    return steps


def _increments(name: str, values: list[float], size: int) -> np.ndarray:
    array = np.array(values or [0.0], dtype=float)
    fits = array.ndim == 1 and array.size in (1, size)
    if not (fits and np.all((array >= 0.0) & np.isfinite(array))):
        raise InputError(
            f"encoders: {name} = {values}; must be none, one or {size} numbers, finite and "
            "not negative"
        )
    return np.broadcast_to(array, size)
