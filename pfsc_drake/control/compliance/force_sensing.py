"""One tick of a force/torque sensor and of the compensation behind it, as compiled functions."""

import casadi as ca
import numpy as np

from pfsc_drake.control.compliance.tool_load import SensorFault


def guarded_compensation(compensation: ca.Function, measurement_range: np.ndarray) -> ca.Function:
    """Return a compensation that gives nothing before taring and after a fault.

    Args:
        compensation: See :func:`~pfsc_drake.control.compliance.tool_load.compensation_function`.
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
