"""Order of partial derivatives in arrays: by total order, inside one from theta_1 to theta_2."""

# A law of order five reads one order more.
MAX_PARTIAL_ORDER = 6


def partial_count(order: int) -> int:
    """Return how many partial derivatives there are up to a total order."""
    return (order + 1) * (order + 2) // 2


def partial_index(i: int, j: int) -> int:
    """Return the row of the derivative i times by theta_1 and j times by theta_2."""
    return partial_count(i + j - 1) + j


def partial_orders(order: int) -> list[tuple[int, int]]:
    """Return ``(i, j)`` of all rows up to a total order: (0, 0), (1, 0), (0, 1), (2, 0), ..."""
    return [(n - j, j) for n in range(order + 1) for j in range(n + 1)]
