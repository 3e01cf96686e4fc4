"""Compensation of a tool's weight and inertia in a force/torque measurement, and alarms."""

from dataclasses import dataclass, field
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, first_of, latch, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.compliance.jump_watch import JumpWatch
from pfsc_drake.control.compliance.measured_wrench import (
    STILL_TIME,
    TARING_BLOCK,
    SensorFault,
    Taring,
    memory_size,
    stands_still,
)
from pfsc_drake.control.estimation.filters import LowPass
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad, dead_band, predicted_load
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import NotNegative, Numbers, OneOf, Parameters, Positive, Range

_INERTIA = ("none", "differentiated", "given")
# rad/s or m/s; above this joint speed the load on a sensor is never constant
_MOVING = 1e-2

_Limits = Annotated[np.ndarray, Numbers(6, Range(0.0, open=True, infinite=True))]


@dataclass
class ToolCompensationParameters(Parameters):
    """Compensation of the tool's load in a measurement.

    Attributes:
        inertia: ``differentiated``: inertial load from filtered differences of the joint
            velocities; ``given``: from accelerations of another component;
            ``none``: only the weight.
        bandwidth: Bandwidth of the filter for the joints' motion [Hz]; equal to the sensor's.
        taring_time: Length of the window whose mean becomes the bias [s].
        taring_spread: Largest difference of means over 10 ms within the window, shape (6,)
            [N, Nm].
        taring_bias: Largest plausible bias, shape (6,) [N, Nm]; a hand that rests on the tool, or
            another tool, must not become a bias.
        force_dead_band: Dead band of forces [N].
        torque_dead_band: Dead band of torques [Nm].
        noise: Nominal standard deviation of a sample, shape (6,) [N, Nm]: a sensor with noise whose
            samples are equal to the last bit is lost. 0 if the resolution is coarser.
        jump: Largest steps within one sample, shape (6,) [N, Nm]: a larger permanent step is a
            fault of the sensor, see
            :class:`~pfsc_drake.control.compliance.jump_watch.JumpWatch`. ``.inf`` for none.
    """

    inertia: Annotated[str, OneOf(_INERTIA)] = "differentiated"
    bandwidth: Positive = 200.0
    taring_time: Positive = 0.05
    taring_spread: _Limits = field(
        default_factory=lambda: np.repeat([1.0, 0.05], 3), metadata=equal(6, parts=2)
    )
    taring_bias: _Limits = field(
        default_factory=lambda: np.repeat([50.0, 2.0], 3), metadata=equal(6, parts=2)
    )
    force_dead_band: NotNegative = 0.0
    torque_dead_band: NotNegative = 0.0
    noise: Annotated[np.ndarray, Numbers(6, Range(0.0))] = field(
        default_factory=lambda: np.zeros(6), metadata=equal(6, parts=2)
    )
    jump: _Limits = field(
        default_factory=lambda: np.repeat([25.0, 1.0], 3), metadata=equal(6, parts=2)
    )


@once_per_content()
def compensation_function(
    robot: RobotModel,
    load: ToolLoad,
    low_pass: LowPass,
    inertia: str = "differentiated",
    dead_bands: tuple[float, float] = (0.0, 0.0),
) -> ca.Function:
    """Return the function from a measurement to the external wrench at the tool point.

    ``r = measured - predicted``; with ``[f, tau] = r - bias`` the external wrench is
    ``R_WS f`` and ``R_WS (tau - p_ST x f)``, both shortened by a dead band. The motion goes
    through the low-pass, so that load and measurement have the same delay.

    Args:
        robot: The robot.
        load: The tool.
        low_pass: Filter of the joints' motion.
        inertia: ``differentiated``, ``given`` or ``none``.
        dead_bands: Widths for force [N] and torque [Nm].

    Returns:
        ``(motion, state, known, measured, bias) -> (wrench at the tool point in W, residual
        r in S, next state)``. ``motion`` is ``[q, v]``, shape (2N,), with given inertia
        ``[q, v, a]``; ``state`` is the state of the filter, which rests on the motion if not
        ``known``: of the size of ``motion``, and N larger for rigid joints with
        differentiated inertia.
    """
    n = robot.dimension
    size = 3 * n if inertia == "given" else 2 * n
    differentiated = inertia == "differentiated"
    # rigid joints accelerate in steps, as drive torques are sampled, and their acceleration is the
    # difference of the velocity over the last interval; the trapezoidal rule would oscillate
    stepwise = differentiated and not robot.is_elastic
    memory = ca.SX.sym("state", size + n * stepwise)
    motion, known = ca.SX.sym("motion", size), ca.SX.sym("known")
    measured, bias = ca.SX.sym("measured", 6), ca.SX.sym("bias", 6)
    state = ca.if_else(known, memory[:size], low_pass.rest(motion))
    q, v, a = ca.vertsplit(ca.vertcat(low_pass.output(state, motion), ca.SX(3 * n - size, 1)), n)
    next_state = low_pass.update(state, motion)
    if differentiated:
        a = low_pass.derivative(state[n:], motion[n:])
        if stepwise:
            # the mean of two trapezoidal derivatives is the filtered difference
            next_state = ca.vertcat(next_state, a)
            a = (a + ca.if_else(known, memory[size:], 0.0)) / 2.0
    elif inertia == "none":
        v = ca.SX(n, 1)
    joints = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(n)]
    predicted, R_WS = predicted_load(robot, load, joints)
    residual = measured - predicted
    external = residual - bias
    force = R_WS @ external[:3]
    torque = R_WS @ (external[3:] - ca.cross(ca.SX(load.p_ST), external[:3]))
    wrench = ca.vertcat(dead_band(force, dead_bands[0]), dead_band(torque, dead_bands[1]))
    results = [wrench, residual, next_state]
    return ca.Function(
        "tool_compensation",
        [motion, memory, known, measured, bias],
        ca.cse([ca.densify(result) for result in results]),
        ["motion", "state", "known", "measured", "bias"],
        ["wrench", "residual", "next_state"],
    )


class ToolCompensation(Block):
    """Estimates the external wrench on the tool.

    With the residual load r = measured - predicted, which the tool alone does not explain (see
    :func:`compensation_function`), the output is ``r - b`` as a wrench at the tool point in world
    axes, applied **to** the robot. The bias b is the mean of r over the first quiet window (see
    :class:`Taring`). Until then the output is exactly zero, so that an untared sensor moves
    nothing; taring continues while the sensor is saturated or its reading changes. A constant
    force during taring is taken for bias, as with any such sensor.

    The joints' motion goes through the same filter as the sensor's signal, so that load
    and measurement have the same delay.

    A measurement or joint state with NaN or infinite values, components of the measurement that are
    constant while others or the robot move (see :func:`stands_still`), and, after taring, a reading
    that jumps (see :class:`JumpWatch`) set the output to zero and cause a fault that only a new
    initialization clears. Saturation is reported while it lasts; the output is then saturated,
    too.

    Ports:
        measured_wrench (input): ``[force, torque]`` in the sensor frame, shape (6,) [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        joint_acceleration (input): ``q_J''``, shape (N,); only with inertia ``given``. It
            must not depend on this block's output in the same tick.
        wrench (output): ``[force, torque]`` at the tool point, world axes, shape (6,) [N, Nm].
        tared (output): 1 once the bias is known, otherwise 0; no direct feedthrough.
        fault (output): A :class:`SensorFault`.
        residual (output): r, in the sensor frame, zero while the sensor is lost, shape (6,)
            [N, Nm].

    State:
        The ``bias``, shape (6,); whether it is ``tared``; the latched ``fault``, LOST, JUMPED or
        none; the window of taring (``taring_..``); the ``filter`` of the joints' motion, shape
        (2N,) or (3N,), which rests on the first motion until it is ``known``; the memory
        of :func:`stands_still` (``watched``), and the ``last`` three r, each of shape (18,).

    Args:
        robot: The robot with the tool.
        load: Everything behind the sensor.
        measurement_range: Measurement range of the sensor, shape (6,) [N, Nm].
        parameters: Parameters of the compensation.
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth does not suit the period.
    """

    def __init__(
        self,
        robot: RobotModel,
        load: ToolLoad,
        measurement_range: np.ndarray,
        parameters: ToolCompensationParameters,
        period: float,
    ) -> None:
        n = robot.dimension
        self._function = compensation_function(
            robot,
            load,
            LowPass(parameters.bandwidth, period),
            parameters.inertia,
            (parameters.force_dead_band, parameters.torque_dead_band),
        )
        self._taring = Taring(
            max(1, round(parameters.taring_time / period)),
            parameters.taring_spread,
            parameters.taring_bias,
            max(1, round(TARING_BLOCK / period)),
        )
        self._still_samples = max(10, round(STILL_TIME / period))
        self._is_noisy = np.asarray(parameters.noise) > 0.0
        self._jumps = JumpWatch(parameters.jump, parameters.noise, parameters.bandwidth, period)
        self._range = ca.DM(np.asarray(measurement_range, dtype=float))
        self._measured_motion = 2 * n
        self.inputs = {"measured_wrench": Port(6, "N, Nm"), "joint_state": Port(4 * n)}
        if parameters.inertia == "given":
            self.inputs["joint_acceleration"] = Port(n)
        self.outputs = {
            "wrench": Port(6, "N, Nm"),
            "tared": Port(1),
            "fault": Port(1),
            "residual": Port(6, "N, Nm"),
        }
        remembered = {
            "filter": self._function.numel_in("state"),
            "watched": memory_size(6),
            "last": JumpWatch.size,
        }
        self.inner = {f"next_{name}": size for name, size in remembered.items()}
        self.states = {"bias": 6, "tared": 1, "fault": 1, "known": 1} | remembered
        self.states |= Taring.states

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        measured, motion = u.measured_wrench, u.joint_state[: self._measured_motion]
        if "joint_acceleration" in self.inputs:
            motion = ca.vertcat(motion, u.joint_acceleration)
        at_range = ca.fabs(measured) >= self._range
        speeds = u.joint_state[self._measured_motion // 2 : self._measured_motion]
        moves = any_of(ca.fabs(speeds) > _MOVING)
        still, watched = stands_still(
            measured, x.watched, at_range, self._still_samples, self._is_noisy, moves
        )
        wrench, residual, filtered = self._function(motion, x.filter, x.known, measured, x.bias)
        jumped, last = self._jumps.step(residual, x.last, at_range)
        lost = ca.logic_or(ca.logic_not(all_finite(wrench, residual, filtered)), still)
        found = first_of(
            (lost, SensorFault.LOST),
            (all_of(jumped, x.tared), SensorFault.JUMPED),
            otherwise=SensorFault.NONE,
        )
        broken = latch(x.fault, found)
        good = ca.logic_not(broken)
        return {
            "wrench": where(all_of(good, x.tared), wrench, 0.0),
            "tared": x.tared,
            "fault": first_of(
                (broken, broken),
                (any_of(at_range), SensorFault.SATURATED),
                otherwise=SensorFault.NONE,
            ),
            "residual": where(good, residual, 0.0),
            "next_filter": where(good, filtered, x.filter),
            "next_watched": where(good, watched, x.watched),
            "next_last": where(good, last, x.last),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        is_quiet = y.fault == SensorFault.NONE
        broken = all_of(ca.logic_not(is_quiet), y.fault != SensorFault.SATURATED)
        stretch = self._taring.extend(x, y.residual)
        bias, is_long, is_plausible = self._taring.bias(stretch)
        tares = ca.logic_not(ca.logic_or(broken, x.tared))
        found = all_of(tares, is_quiet, is_long, is_plausible)
        goes_on = ca.logic_and(is_quiet, ca.logic_not(is_long))
        return {
            "bias": where(found, bias, x.bias),
            "tared": ca.logic_or(x.tared, found),
            "fault": where(broken, y.fault, x.fault),
            "known": ca.logic_or(x.known, ca.logic_not(broken)),
            "filter": y.next_filter,
            "watched": y.next_watched,
            "last": y.next_last,
        } | {
            name: where(tares, where(goes_on, getattr(stretch, name), 0.0), getattr(x, name))
            for name in Taring.states
        }


class Alarms(Block):
    """Combines alarms of force sensor and compliance and stop requests into a fault.

    Ports:
        alarms (input, optional): A
            :class:`~pfsc_drake.control.compliance.tool_compensation.SensorFault`, whether the
            sensor is tared (before taring its saturation is ignored), an
            :class:`~pfsc_drake.control.compliance.impedance.ImpedanceStatus`, and whether the
            contact force is lost, shape (4,).
        stop_request (input, optional): Nonzero to stop the robot, shape (1,).
        fault (output): A :class:`~pfsc_drake.control.law.fault.Fault`, shape (1,).
    """

    def __init__(self) -> None:
        self.inputs = {
            "alarms": Port(4, optional=True),
            "stop_request": Port(1, optional=True),
        }
        self.outputs, self.states = {"fault": Port(1)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        requested = (
            Fault.NONE
            if u.stop_request is None
            else where(u.stop_request, Fault.STOP_REQUESTED, Fault.NONE)
        )
        if u.alarms is None:
            return {"fault": ca.DM(requested) if u.stop_request is None else requested}
        sensor, tared, compliance, press_lost = ca.vertsplit(u.alarms)
        fault = first_of(
            (sensor == SensorFault.LOST, Fault.FORCE_SENSOR_LOST),
            (
                ca.logic_and(sensor == SensorFault.SATURATED, tared),
                Fault.FORCE_SENSOR_SATURATED,
            ),
            (sensor == SensorFault.JUMPED, Fault.FORCE_SENSOR_JUMPED),
            (compliance, Fault.COMPLIANCE_INVALID),
            (press_lost, Fault.PRESS_FORCE_LOST),
            otherwise=requested,
        )
        return {"fault": fault}
