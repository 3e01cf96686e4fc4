"""Friction in a run: what is true of it, what a controller thinks of it, and the errors.

Signals used, as in the log: ``friction_estimate`` and ``tau_f`` [samples, axes];
``f_c_estimate``, ``f_c``, ``f_v_estimate`` and ``f_v`` [samples, axes].
"""

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.estimation.momentum import drive_momentum
from reporting.metrics import Metrics

_COEFFICIENTS = {"f_c": "coulomb", "f_v": "viscous"}


def add_friction(log: RunLog, station: Station, raw: dict[str, FloatArray]) -> None:
    """Add friction, its estimate, and the momenta and coefficients if those are estimated.

    Args:
        log: Of the run.
        station: The station that was simulated.
        raw: What its station logged.
    """
    if "friction_torque" in raw:
        log.add("tau_f", raw["friction_torque"])
    if "friction_estimate" not in raw:
        return
    estimate, axes = raw["friction_estimate"], station.robot.dimension
    parts = np.split(estimate, estimate.shape[1] // axes, axis=1)
    names = ("friction_estimate", "f_c_estimate", "f_v_estimate")
    for name, part in zip(names, parts, strict=False):
        log.add(name, part)
    if len(parts) == 1:
        return
    if "tau_f" in log:
        friction = station.diagram.GetSubsystemByName("joint_friction")
        for name, values in zip(("f_c", "f_v"), friction.coefficients(log.time), strict=True):
            log.add(name, values)
    log.add("momentum", _momentum(station, raw["joint_state"]))


def friction_metrics(log: RunLog) -> Metrics:
    """Return the metrics of friction that the log has signals for.

    Errors of coefficients are those at the last sample, of each axis and of the worst.
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
        metrics.add(f"max_{kind}_error", float(np.nanmax(errors, initial=0.0)))
        for axis, value in enumerate(errors, start=1):
            metrics.add(f"{kind}_error_{axis}", float(value))
    return metrics


def relative_errors(log: RunLog, name: str) -> FloatArray:
    """Return the errors of estimated coefficients, by the true ones, shape (samples, axes).

    NaN where there is no such friction.

    Args:
        log: With an estimate and its truth.
        name: ``f_c`` or ``f_v``.
    """
    estimate, truth = log[f"{name}_estimate"].values, log[name].values
    return np.asarray(estimate / np.where(truth > 0.0, truth, np.nan) - 1.0)


def _momentum(station: Station, state: FloatArray) -> FloatArray:
    """Return the momenta on which friction acts, shape (samples, N), of App. A's ``D(q) q'``."""
    if len(state) == 0:
        return np.zeros((0, station.robot.dimension))
    function = drive_momentum(station.robot).function.map(len(state))
    return np.array(function(state.T)[0]).T
