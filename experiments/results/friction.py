"""Friction in a run: what is true of it, what a controller thinks of it, and the errors.

Signals used, as in the log: ``friction_estimate`` and ``tau_f`` [samples, axes];
``f_c_estimate``, ``f_c``, ``f_v_estimate`` and ``f_v`` [samples, axes].
"""

from collections.abc import Collection

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.estimation.momentum import drive_momentum
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


def friction_signals(station: Station) -> set[str]:
    """Return which of these signals the log of a station has.

    Args:
        station: The station, simulated or not.
    """
    rows = station.log.rows
    names = {"tau_f"} if "friction_torque" in rows else set()
    if "friction_estimate" in rows:
        names.add("friction_estimate")
    estimate = rows.get("friction_estimate")
    if estimate is not None and estimate.stop - estimate.start > station.robot.dimension:
        names |= {"f_c_estimate", "f_v_estimate", "momentum"}
        if "tau_f" in names:
            names |= {"f_c", "f_v"}
    return names


def add_friction(log: RunLog, station: Station, raw: dict[str, FloatArray], effort: str) -> None:
    """Add the signals of this module that there are.

    Args:
        log: Of the run.
        station: The station that was simulated.
        raw: What its station logged.
        effort: Unit of the drives.
    """
    names = friction_signals(station)
    axes = range(1, station.robot.dimension + 1)
    if "tau_f" in names:
        log.add("tau_f", raw["friction_torque"], effort, [f"tau_f_{axis}" for axis in axes])
    if "friction_estimate" in names:
        _add_estimate(log, raw["friction_estimate"], effort, len(axes))
    if "f_c" in names:
        friction = station.diagram.GetSubsystemByName("joint_friction")
        for name, values in zip(("f_c", "f_v"), friction.coefficients(log.time), strict=True):
            labels = [f"{name}_{axis}" for axis in axes]
            log.add(name, values, log[f"{name}_estimate"].unit, labels)
    if "momentum" in names:
        unit = f"{effort.replace(' or ', ' s or ')} s"
        log.add("momentum", _momentum(station, raw["joint_state"]), unit, [f"p_{a}" for a in axes])


def _add_estimate(log: RunLog, estimate: FloatArray, effort: str, axes: int) -> None:
    """Add what is thought of friction: torques, and coefficients if they are estimated."""
    names = {"friction_estimate": ("tau_f", effort), "f_c_estimate": ("f_c", effort)}
    names["f_v_estimate"] = ("f_v", f"{effort} s/rad" if effort == "Nm" else f"{effort} s/m")
    parts = np.split(estimate, estimate.shape[1] // axes, axis=1)
    for (name, (symbol, unit)), values in zip(names.items(), parts, strict=False):
        log.add(name, values, unit, [f"{symbol}_estimate_{i + 1}" for i in range(axes)])


def _momentum(station: Station, state: FloatArray) -> FloatArray:
    """Return the momenta on which friction acts, shape (samples, N), of App. A's ``D(q) q'``."""
    if len(state) == 0:
        return np.zeros((0, station.robot.dimension))
    function = drive_momentum(station.robot).function.map(len(state))
    return np.array(function(state.T)[0]).T
