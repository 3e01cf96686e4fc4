"""Cases of a law as expressions, which read like the dissertation's braces.

All branches are evaluated, and one is selected; NaN or infinite values of the others do not matter.
Conditions are 1 or 0. A comparison with NaN is 0, so write it such that 0 is the safe side.
"""

from collections.abc import Mapping
from functools import reduce
from typing import Any

import casadi as ca


def where(condition: Any, value: Any, otherwise: Any) -> Any:
    """Return one of two values, entry by entry; scalars stand for all entries.

    Args:
        condition: Number or expression, shape () or (k,); nonzero for the first.
        value: The first, shape () or (k,).
        otherwise: The second, shape () or (k,).
    """
    return ca.if_else(condition, value, otherwise)


def first_of(*cases: tuple[Any, Any], otherwise: Any) -> Any:
    """Return the value of the first case whose condition holds.

    ``first_of((x < 0, -1), (x > 0, 1), otherwise=0)`` is -1 if ``x < 0``, 1 if ``x > 0``, else 0.

    Args:
        cases: Conditions and values, see :func:`where`.
        otherwise: The value if no condition holds.
    """
    return reduce(lambda rest, case: where(case[0], case[1], rest), reversed(cases), otherwise)


def latch(before: Any, now: Any) -> Any:
    """Return the value before if it is not zero, else the present one: the first nonzero one stays.

    Args:
        before: Last result, shape (k,).
        now: Present value, shape (k,).
    """
    return where(before, before, now)


def any_of(*conditions: Any) -> Any:
    """Return whether one condition holds, shape (1,).

    Args:
        conditions: Each of any shape.
    """
    return ca.sum1(ca.vertcat(*[ca.vec(condition) != 0.0 for condition in conditions])) > 0.0


def all_of(*conditions: Any) -> Any:
    """Return whether all conditions hold, shape (1,).

    Args:
        conditions: Each of any shape.
    """
    return ca.logic_not(any_of(*[ca.logic_not(condition) for condition in conditions]))


def is_finite(x: Any) -> Any:
    """Return which entries are finite numbers, of the shape of x.

    Args:
        x: Numbers or expressions.
    """
    return ca.fabs(x) < ca.inf


def all_finite(*parts: Any) -> Any:
    """Return whether all entries are finite numbers, shape (1,).

    The sum of the entries is tested: it is finite only if all its terms are, unless it overflows.

    Args:
        parts: Each of any shape.
    """
    return is_finite(ca.sum1(ca.vertcat(*[ca.vec(part) for part in parts])))


def least(values: Any, counts: Any) -> Any:
    """Return the index of the least of the values that count, -1 if none does.

    Args:
        values: Shape (k,); NaN does not count.
        counts: Conditions, shape (k,).
    """
    which, lowest = -1, ca.inf
    for i in range(values.numel()):
        lower = ca.logic_and(counts[i], values[i] < lowest)
        which, lowest = where(lower, i, which), where(lower, values[i], lowest)
    return which


def unit(which: Any, size: int) -> Any:
    """Return 1 at an index, and 0 elsewhere, shape (size,).

    Args:
        which: The index; if it is out of range, all entries are 0.
        size: k.
    """
    return ca.vertcat(*[which == i for i in range(size)])


def hold_if_not_finite(after: Mapping[str, Any], before: Any) -> tuple[dict[str, Any], Any]:
    """Return updated states, or the present ones if not all are finite, and which, shape (1,).

    Args:
        after: Updated states, by name.
        before: Present states, as attributes.
    """
    good = all_finite(*after.values())
    return {name: where(good, value, getattr(before, name)) for name, value in after.items()}, good
