"""One tick of a force/torque sensor and of the compensation behind it, as compiled functions."""

import casadi as ca
import numpy as np

from pfsc_drake.control.tool_load import LowPass, SensorFault


def transducer_function(
    low_pass: LowPass, bias: np.ndarray, measurement_range: np.ndarray
) -> ca.Function:
    """Return what a sensor makes of its load, ``clip(lowpass(load) + bias + noise)``.

    Args:
        low_pass: The amplifier's filter.
        bias: Reading without load, shape (6,) [N, Nm].
        measurement_range: Largest magnitude that is measured, shape (6,) [N, Nm].

    Returns:
        ``(reaction, state, noise) -> (reading, load, next_state)``, each (6,). The reaction
        is ``[torque, force]`` on the tool, as in Drake, the load ``[force, torque]`` its
        opposite. The filter rests on the load where its state is NaN; a load that is NaN is
        read as NaN.
    """
    reaction, memory, noise = (ca.SX.sym(name, 6) for name in ("reaction", "state", "noise"))
    load = -ca.vertcat(reaction[3:], reaction[:3])
    state = ca.if_else(_is_nan(memory), low_pass.rest(load), memory)
    reading = low_pass.output(state, load) + bias + noise
    # unlike a minimum, a comparison lets NaN through
    reading = ca.if_else(reading > measurement_range, measurement_range, reading)
    reading = ca.if_else(reading < -measurement_range, -measurement_range, reading)
    return ca.Function(
        "transducer",
        [reaction, memory, noise],
        ca.cse([ca.densify(x) for x in (reading, load, low_pass.update(state, load))]),
        ["reaction", "state", "noise"],
        ["reading", "load", "next_state"],
    )


def guarded_compensation(compensation: ca.Function, measurement_range: np.ndarray) -> ca.Function:
    """Return a compensation that gives nothing before taring and after a fault.

    Args:
        compensation: See :func:`~pfsc_drake.control.tool_load.compensation_function`.
        measurement_range: Of the sensor, shape (6,) [N, Nm].

    Returns:
        ``(motion, measured, bias, known, tared, fault, state) -> result`` with the flat
        result ``[wrench, tared, fault, residual, next_state]``. The fault is that of this
        tick, a :class:`SensorFault`: NOT_FINITE, which persists, if a value is not finite
        (then residual is zero and the filter's state stays), else SATURATED if the
        measurement is at its range. The wrench is zero unless tared and finite.
    """
    names = ("motion", "measured", "bias", "known", "tared", "fault", "state")
    sizes = {name: compensation.numel_in(name) for name in ("motion", "measured", "bias", "state")}
    x = {name: ca.SX.sym(name, sizes.get(name, 1)) for name in names}
    wrench, residual, next_state = compensation(
        x["motion"], x["state"], x["known"], x["measured"], x["bias"]
    )
    total = ca.sum1(wrench) + ca.sum1(residual) + ca.sum1(next_state)
    # a sum is finite only if all its terms are, and no comparison with NaN holds
    finite = ca.logic_and(ca.fabs(total) < ca.inf, x["fault"] != SensorFault.NOT_FINITE)
    saturated = ca.sum1(ca.fabs(x["measured"]) >= measurement_range) > 0
    fault = ca.if_else(
        finite, ca.if_else(saturated, SensorFault.SATURATED, x["fault"]), SensorFault.NOT_FINITE
    )
    result = ca.vertcat(
        ca.if_else(ca.logic_and(finite, x["tared"]), wrench, 0.0),
        x["tared"],
        fault,
        ca.if_else(finite, residual, 0.0),
        ca.if_else(finite, next_state, x["state"]),
    )
    return ca.Function(
        "guarded_compensation",
        list(x.values()),
        ca.cse([ca.densify(result)]),
        list(names),
        ["result"],
    )


def _is_nan(value: ca.SX) -> ca.SX:
    return ca.logic_not(ca.fabs(value) <= ca.inf)
