"""How a projection onto a manifold ended."""

from enum import IntEnum


class ProjectionStatus(IntEnum):
    """Value of the field `status` of a manifold's point."""

    OK = 0
    BEYOND_END = 1
    NOT_CONVERGED = 2
