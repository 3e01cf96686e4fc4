"""Metrics of what a controller thinks of friction, each a pure function of a run's log.

Signals used, as in the log: ``friction_estimate`` and ``tau_f`` [samples, axes];
``f_c_estimate``, ``f_c``, ``f_v_estimate`` and ``f_v`` [samples, axes].
"""

from collections.abc import Collection

import numpy as np

from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics

_COEFFICIENTS = {"f_c": "coulomb", "f_v": "viscous"}


def relative_errors(log: RunLog, name: str) -> FloatArray:
    """Errors of estimated coefficients, in units of the true ones.

    Args:
        log: With an estimate and its truth.
        name: ``f_c`` or ``f_v``.

    Returns:
        [samples, axes] 1; NaN where there is no such friction.
    """
    estimate, truth = log[f"{name}_estimate"].values, log[name].values
    return np.asarray(estimate / np.where(truth > 0.0, truth, np.nan) - 1.0)


def friction_metrics(log: RunLog) -> Metrics:
    """All metrics of this module that the log has signals for.

    Errors of coefficients are those at the last sample, of each axis and of the worst.

    Args:
        log: Of a path following run.
    """
    metrics = Metrics()
    if log.time.size == 0:
        return metrics
    if "friction_estimate" in log and "tau_f" in log:
        error = log["friction_estimate"].values - log["tau_f"].values
        for axis, rms in enumerate(np.sqrt(np.mean(error**2, axis=0)), start=1):
            metrics.add(f"rms_friction_error_{axis}", float(rms), log["tau_f"].unit)
    for name, kind in _COEFFICIENTS.items():
        if f"{name}_estimate" not in log or name not in log:
            continue
        errors = np.abs(relative_errors(log, name)[-1])
        metrics.add(f"max_{kind}_error", float(np.nanmax(errors, initial=0.0)), "1")
        for axis, value in enumerate(errors, start=1):
            metrics.add(f"{kind}_error_{axis}", float(value), "1")
    return metrics


def friction_metric_names(num_joints: int, signals: Collection[str]) -> list[str]:
    """Return the names of the metrics that :func:`friction_metrics` gives.

    Args:
        num_joints: Number of drives.
        signals: Those that the log has.
    """
    axes, names = range(1, num_joints + 1), []
    if {"friction_estimate", "tau_f"} <= set(signals):
        names += [f"rms_friction_error_{axis}" for axis in axes]
    for name, kind in _COEFFICIENTS.items():
        if {f"{name}_estimate", name} <= set(signals):
            names += [f"max_{kind}_error", *(f"{kind}_error_{axis}" for axis in axes)]
    return names
