"""What a robot may have done between two statuses of which others were lost."""

import numpy as np


def state_between(before: np.ndarray, after: np.ndarray, share: float, span: float) -> np.ndarray:
    """Return the joint state at a share of a span of time, positions being cubic in it.

    Args:
        before: ``[q, v, q, v]`` where it begins, shape (4N,).
        after: The same where it ends.
        share: 0 to 1.
        span: The time between both [s].
    """
    q_0, v_0 = np.split(before, 4)[:2]
    q_1, v_1 = np.split(after, 4)[:2]
    rest = 1.0 - share
    square = share * share
    ways = (square * (3.0 - 2.0 * share), span * share * (rest * rest), span * square * rest)
    rates = (6.0 * share * rest / span, rest * (1.0 - 3.0 * share), share * (1.0 - 3.0 * rest))
    q = q_0 + ways[0] * (q_1 - q_0) + ways[1] * v_0 - ways[2] * v_1
    v = rates[0] * (q_1 - q_0) + rates[1] * v_0 + rates[2] * v_1
    return np.concatenate([q, v, q, v])
