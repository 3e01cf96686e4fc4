"""Times of recorded inputs: a column in seconds, in older files one in sampling intervals."""

import numpy as np

from pfsc_drake.errors import InputError

TIME, TICK = "time", "tick"
# share of a sampling interval by which a time may be early
_ROUNDING = 1e-3
_DECIMALS = 9


def time_column(header: list[str]) -> str:
    """Return the name of the column with times.

    Args:
        header: Names of a file's columns.
    """
    return TICK if TICK in header and TIME not in header else TIME


def time_text(tick: int, period: float) -> str:
    """Return a sampling instant as an entry of the column :data:`TIME`.

    Args:
        tick: Its number.
        period: Sampling time [s].
    """
    return repr(round(tick * period, _DECIMALS)).removesuffix(".0")


def sampling_instants(name: str, column: str, times: np.ndarray, period: float) -> np.ndarray:
    """Return the first sampling instants not before given times, shape (rows,).

    Args:
        name: The file.
        column: :data:`TIME`, in s, or :data:`TICK`, in sampling intervals of the scenario.
        times: Its values, shape (rows,).
        period: Sampling time [s].

    Raises:
        InputError: If a time is negative or less than the one before, or a tick no whole number.
    """
    if np.any(times < 0.0) or np.any(np.diff(times) < 0.0):
        raise InputError(f"{name}: column '{column}' must not be negative and not decrease")
    if column == TIME:
        return np.ceil(times / period - _ROUNDING)
    if np.any(times != np.round(times)):
        raise InputError(f"{name}: column '{column}' must be whole numbers")
    return times
