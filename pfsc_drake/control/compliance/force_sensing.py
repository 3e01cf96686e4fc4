"""One tick of a force/torque sensor and of the compensation behind it, as compiled functions."""

import casadi as ca
import numpy as np

from pfsc_drake.control.compliance.still_components import memory_size, stands_still
from pfsc_drake.control.compliance.tool_load import SensorFault


def guarded_compensation(
    compensation: ca.Function,
    measurement_range: np.ndarray,
    still_samples: int,
    noise: np.ndarray,
) -> ca.Function:
    """Return a compensation that gives nothing before taring and after a fault.

    Args:
        compensation: See :func:`~pfsc_drake.control.compliance.tool_load.compensation_function`.
        measurement_range: Of the sensor, shape (6,) [N, Nm].
        still_samples: For how many samples a component must have stood still to be lost, see
            :func:`~pfsc_drake.control.compliance.still_components.stands_still`.
        noise: Standard deviation of a sample as it is believed, shape (6,) [N, Nm].

    Returns:
        ``(motion, measured, bias, known, tared, fault, state) -> result`` with the flat
        result ``[wrench, tared, fault, residual, next_state]``. The fault is that of this
        tick, a :class:`SensorFault`: LOST, which persists, if a value is not finite or a component
        stands still (then residual is zero and the state stays), else SATURATED if the measurement
        is at its range. The wrench is zero unless tared and not lost. The state is that of the
        compensation, and what is remembered of the measurement, shape (18,).
    """
    names = ("motion", "measured", "bias", "known", "tared", "fault", "state")
    sizes = {name: compensation.numel_in(name) for name in ("motion", "measured", "bias", "state")}
    of_filter = sizes["state"]
    sizes["state"] += memory_size(sizes["measured"])
    x = {name: ca.SX.sym(name, sizes.get(name, 1)) for name in names}
    at_range = ca.fabs(x["measured"]) >= measurement_range
    filtered, watched = ca.vertsplit(x["state"], [0, of_filter, sizes["state"]])
    still, next_watched = stands_still(
        x["measured"], watched, at_range, still_samples, np.asarray(noise) > 0.0
    )
    wrench, residual, next_filtered = compensation(
        x["motion"], filtered, x["known"], x["measured"], x["bias"]
    )
    next_state = ca.vertcat(next_filtered, next_watched)
    total = ca.sum1(wrench) + ca.sum1(residual) + ca.sum1(next_filtered)
    # a sum is finite only if all its terms are, and no comparison with NaN holds
    finite = ca.logic_and(ca.fabs(total) < ca.inf, x["fault"] != SensorFault.LOST)
    good = ca.logic_and(finite, ca.logic_not(still))
    saturated = ca.sum1(at_range) > 0
    fault = ca.if_else(
        good, ca.if_else(saturated, SensorFault.SATURATED, x["fault"]), SensorFault.LOST
    )
    result = ca.vertcat(
        ca.if_else(ca.logic_and(good, x["tared"]), wrench, 0.0),
        x["tared"],
        fault,
        ca.if_else(good, residual, 0.0),
        ca.if_else(good, next_state, x["state"]),
    )
    return ca.Function(
        "guarded_compensation",
        list(x.values()),
        ca.cse([ca.densify(result)]),
        list(names),
        ["result"],
    )
