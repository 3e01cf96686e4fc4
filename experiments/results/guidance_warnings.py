"""What did not go within fixtures as it was believed, said after a run."""

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario import Scenario
from experiments.results.guidance_signals import slots_of
from experiments.results.run_log import FloatArray, RunLog

# ticks over which motion is compared, and m/s by which it has to change meanwhile, rms
_SPAN, _MOVED = 20, 2e-3
# of the lag, and s, that it may be wrong by
_SHARE, _LEAST = 0.3, 1e-3
# m, from a region that leaves no room
_TIGHT = 1e-3


def guidance_warnings(log: RunLog, settings: Scenario) -> list[str]:
    """Return what a run within fixtures has shown to be otherwise, one sentence each.

    Args:
        log: Of the run.
        settings: Its scenario.
    """
    if "squeezed" not in log or not log.time.size or settings.fixtures is None:
        return []
    return [*_squeezed(log), *_late_servos(log, settings)]


def observed_lag(log: RunLog, believed: float) -> float | None:
    """Return the lag of velocity servos, from what was asked of them and measured [s].

    The rules look at ``z = y + tau y' + T sum of commands under way``. Behind servos with
    ``y'' = (v - y') / tau`` it moves by T v in a tick. What it moves beside that is the error of
    ``tau`` times the change of ``y'``.

    Args:
        log: Of a run with the law ``velocity_servo``.
        believed: ``tau`` [s].

    Returns:
        None where the tool hardly moved.
    """
    y = log["y_t_measured" if "y_t_measured" in log else "y_t"].values
    z, v = log["rest_point"].values, log["velocity_command"].values
    known = np.isfinite(v).all(axis=1)
    if np.count_nonzero(known) <= _SPAN:
        return None
    z, v, period = z[known], v[known], float(np.median(np.diff(log.time)))
    # what was asked at a tick counts from the next one on
    error = z - period * (np.cumsum(v, axis=0) - v)
    rate = np.gradient(y[known], period, axis=0)
    beside, change = (x[_SPAN:] - x[:-_SPAN] for x in (error, rate))
    if np.sqrt(np.mean(change**2)) < _MOVED:
        return None
    return believed - float(np.sum(beside * change) / np.sum(change**2))


def _late_servos(log: RunLog, settings: Scenario) -> list[str]:
    fixtures, servo = settings.fixtures, settings.servo
    if fixtures is None or settings.controller.law != "velocity_servo":
        return []
    believed = fixtures.lag_behind(servo.bandwidth)
    lag = observed_lag(log, believed)
    if lag is None or abs(lag - believed) <= max(_SHARE * believed, _LEAST):
        return []
    least = 2.0 * (lag + servo.bus_delay)
    return [
        f"the tool follows the asked velocity by {1e3 * lag:.2g} ms later, not by "
        f"{1e3 * believed:.2g} ms as fixtures.servo_lag has it (by default 1 / servo.bandwidth), "
        f"and so enters regions deeper: set it, and fixtures.guidance.approach_time to {least:.2g} "
        "s or more"
    ]


def _squeezed(log: RunLog) -> list[str]:
    ticks = np.flatnonzero(log["squeezed"].values[:, 0] > 0.5)
    if not ticks.size:
        return []
    distance = log["region_distance"]
    period = float(np.median(np.diff(log.time)))
    names = [
        name
        for i, name in enumerate(distance.labels or [])
        if np.any(_is_tight(slots_of(log, i))[ticks])
    ]
    deepest = -float(np.nanmin(distance.values[ticks], initial=0.0))
    return [
        f"{' and '.join(names)} squeezed the tool for {period * ticks.size:.3g} s from t = "
        f"{log.time[ticks[0]]:.3f} s on: no place near it is admitted by all of them, and it was "
        f"up to {1e3 * deepest:.2g} mm in one"
    ]


def _is_tight(slots: dict[str, FloatArray]) -> NDArray[np.bool_]:
    """Return when the tool was in a hard region, or all but, shape (samples,)."""
    return (slots["stiffness"] == 0.0) & (slots["h"] < _TIGHT)
