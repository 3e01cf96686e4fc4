"""Faults of a controller in C that an object in Python cannot have."""

import enum

from pfsc_drake.control.law.fault import Fault


class CFault(enum.IntEnum):
    """Fault of the calls of a controller in C, beside a :class:`~pfsc_drake.control.law.Fault`."""

    NOT_INITIALIZED = 101
    START_INVALID = 102
    FAULT_INVALID = 103

    @property
    def explanation(self) -> str:
        """One phrase for people."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    CFault.NOT_INITIALIZED: "controller_step was called before controller_initialize",
    CFault.START_INVALID: "controller_initialize was given a value that is NaN, infinite or beyond "
    "1e9",
    CFault.FAULT_INVALID: "the controller found a fault that is not a number of one",
}


def fault_sentences() -> dict[int, str]:
    """Return the sentences of all values that a controller in C returns, by value."""
    return {int(fault): fault.explanation for kind in (Fault, CFault) for fault in kind}
