"""What is thought of friction, what is true of it, and the momenta from which it is found."""

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.estimation.momentum import drive_momentum


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
