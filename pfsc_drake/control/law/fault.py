"""Why a law stops."""

import enum


class Fault(enum.IntEnum):
    """Why a law went to its safe state."""

    NONE = 0
    INPUT_NOT_FINITE = 1
    PROJECTION_FAILED = 2
    OUTSIDE_FEASIBLE_NEIGHBOURHOOD = 3
    SINGULAR = 4

    @property
    def explanation(self) -> str:
        """One phrase for people."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    Fault.NONE: "no fault",
    Fault.INPUT_NOT_FINITE: "a measured value or a reference is not a finite number",
    Fault.PROJECTION_FAILED: "the projection onto the path did not converge",
    Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD: "the tool left the feasible neighbourhood of the path",
    Fault.SINGULAR: "the decoupling matrix is close to singular",
}
