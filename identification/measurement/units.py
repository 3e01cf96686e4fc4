"""Units in which files state signals."""

from collections.abc import Mapping

import numpy as np

from pfsc_drake.errors import InputError

_TURN = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi}
_LENGTH = {"m": 1.0, "mm": 1e-3}
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_RATES: dict[str, dict[str, float]] = {
    "rad": {f"{unit}/s": factor for unit, factor in _TURN.items()} | {"rpm": np.pi / 30.0},
    "m": {f"{unit}/s": factor for unit, factor in _LENGTH.items()},
}
_SECOND_RATES = {
    "rad": {f"{unit}/s^2": factor for unit, factor in _TURN.items()},
    "m": {f"{unit}/s^2": factor for unit, factor in _LENGTH.items()},
}
_POSITIONS = {"rad": _TURN, "m": _LENGTH}
_EFFORTS = {
    "rad": {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3},
    "m": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
_OF_SIGNAL = {
    "q": _POSITIONS,
    "q_motor": _POSITIONS,
    "v": _RATES,
    "a": _SECOND_RATES,
    "tau": _EFFORTS,
}


def si_unit(signal: str, joint_unit: str) -> str:
    """Return the unit that records have.

    Args:
        signal: One of a record's, or ``t``.
        joint_unit: ``rad`` or ``m``.
    """
    return "s" if signal == "t" else next(iter(_OF_SIGNAL[signal][joint_unit]))


def to_si(signal: str, joint_unit: str, unit: str, scale: float | None, where: str) -> float:
    """Return what to multiply a signal by to have it in SI units on the joint side.

    Args:
        signal: One of a record's, or ``t``.
        joint_unit: ``rad`` or ``m``.
        unit: As the file states it.
        scale: SI units per unit of the file, for one that does not say what it is, as
            ``counts`` or ``A``; None if not given.
        where: File and name of the signal, for messages.

    Raises:
        InputError: If the unit is not one of the signal's and there is no scale, or if there is
            one though the unit needs none.
    """
    known: Mapping[str, float] = _TIME if signal == "t" else _OF_SIGNAL[signal][joint_unit]
    if unit in known:
        if scale is not None:
            raise InputError(
                f"{where}: unit [{unit}] with a scale of {scale:g}; a scale is allowed only for "
                "units that do not say what they are, as [counts]"
            )
        return known[unit]
    if scale is None:
        raise InputError(
            f"{where}: unit [{unit}]; allowed: {', '.join(known)}, or another one with a scale, "
            f"in {si_unit(signal, joint_unit)} per {unit or 'unit'}"
        )
    if not np.isfinite(scale) or scale == 0.0:
        raise InputError(f"{where}: scale = {scale}; must be finite and not 0")
    return float(scale)
