"""Metrics of the drives of a run, each a pure function of its log.

Signals used, as in the log: ``tau_d`` [samples, axes] with attribute ``limits``,
``saturated_drives`` and ``fault`` [samples, 1].
"""

import math

import numpy as np

from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.law.fault import Fault

SATURATION_MARGIN = 1e-9  # relative; a clipped command equals the limit up to rounding


def peak_torque(log: RunLog) -> FloatArray:
    """Largest magnitude of the drive torque of each axis.

    Args:
        log: With ``tau_d``.

    Returns:
        [axes] in the unit of ``tau_d``.
    """
    values = np.abs(log["tau_d"].values)
    return np.asarray(np.max(values, axis=0) if len(values) else np.full(values.shape[1], math.nan))


def saturation_count(log: RunLog) -> int:
    """Number of samples at which the law or a drive is at a limit, see :func:`is_saturated`.

    Args:
        log: See there.

    Returns:
        Between 0 and the number of samples.
    """
    return int(np.count_nonzero(is_saturated(log)))


def saturation_warnings(log: RunLog) -> list[str]:
    """Return what there is to say about drives at their limits, one sentence each.

    Args:
        log: As for :func:`is_saturated`.
    """
    saturated = is_saturated(log)
    count = int(np.count_nonzero(saturated))
    if not count:
        return []
    first = float(log.time[int(saturated.argmax())])
    where = ""
    if "eta" in log:
        eta = log["eta"].values[int(saturated.argmax())]
        where = f", eta = {', '.join(f'{x:.3g}' for x in eta)} m"
    return [
        f"drives were at a limit in {count} samples, {100.0 * count / saturated.size:.2g} % of "
        f"the run, first at {first:.3f} s{where}: while they are, nothing that the law promises "
        "holds"
    ]


def is_saturated(log: RunLog) -> np.ndarray:
    """Return at which samples the law or a drive is at a limit, shape (samples,).

    That is, while there is no fault the law asks of a drive more than it may: torque, or with
    velocity servos speed (``saturated_drives``); or the torque of a drive is at its limit,
    whoever commands it: the law, a servo, or the safe state after a fault.

    Args:
        log: With ``tau_d`` and its ``limits``, or ``saturated_drives`` with ``fault``, or both;
            nothing of the others counts.
    """
    saturated = np.zeros(log.time.size, dtype=bool)
    if "tau_d" in log and (signal := log["tau_d"]).limits is not None:
        at_limit = np.abs(signal.values) >= signal.limits * (1.0 - SATURATION_MARGIN)
        saturated |= np.any(at_limit, axis=1)
    if "saturated_drives" in log:
        asked = log["saturated_drives"].values[:, 0] > 0
        # after a fault the drives do not follow the law
        saturated |= asked & (log["fault"].values[:, 0] == Fault.NONE)
    return saturated
