"""The panel of the scenario sfc_scan, whose scan is shipped: its formula, and how it was scanned.

``z = x^2 / 2.5 m + y^2 / 4 m + 8 mm sin(2 pi x / 0.4 m) cos(2 pi y / 0.5 m)`` above the scan's
origin, over 0.5 m x 0.8 m. The scan has 40 x 50 places, each moved by up to a third of a step, and
noise of 0.1 mm along the normal.
"""

import numpy as np

HALF_X, HALF_Y = 0.25, 0.4  # m
ROWS, COLUMNS = 40, 50
NOISE = 1e-4  # m, standard deviation
ORIGIN = np.array([0.85, 0.0, 0.95])  # m, of the scan in the scenario's world
HEIGHT, WAVE_X, WAVE_Y = 0.008, 2.0 * np.pi / 0.4, 2.0 * np.pi / 0.5
_SEED = 4
_STEPS = 20


def height(x, y):
    """Return z [m] at x and y [m] of the scan's axes."""
    return x**2 / 2.5 + y**2 / 4.0 + HEIGHT * np.sin(WAVE_X * x) * np.cos(WAVE_Y * y)


def slopes(x, y):
    """Return dz/dx and dz/dy."""
    along_x = x / 1.25 + HEIGHT * WAVE_X * np.cos(WAVE_X * x) * np.cos(WAVE_Y * y)
    along_y = y / 2.0 - HEIGHT * WAVE_Y * np.sin(WAVE_X * x) * np.sin(WAVE_Y * y)
    return along_x, along_y


def normal(x, y):
    """Return the unit normal upwards, shape (..., 3)."""
    along_x, along_y = slopes(x, y)
    direction = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1)
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def scan():
    """Return the points of the scan in its axes [m], shape (2000, 3)."""
    generator = np.random.default_rng(_SEED)
    step = np.array([2.0 * HALF_X / (ROWS - 1), 2.0 * HALF_Y / (COLUMNS - 1)])
    places = np.stack(np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij"), axis=-1)
    moved = step * (places.reshape(-1, 2) + generator.uniform(-1.0 / 3.0, 1.0 / 3.0, (2000, 2)))
    x, y = np.clip(moved - [HALF_X, HALF_Y], [-HALF_X, -HALF_Y], [HALF_X, HALF_Y]).T
    exact = np.stack([x, y, height(x, y)], axis=-1)
    points = exact + NOISE * generator.normal(size=(len(x), 1)) * normal(x, y)
    return points[generator.permutation(len(points))]


def distance(points):
    """Return signed distances of points near the panel from it [m].

    Args:
        points: In the scenario's world [m], shape (n, 3).
    """
    p = np.asarray(points) - ORIGIN
    foot = p[:, :2].copy()
    for _ in range(_STEPS):  # along the normal, onto the tangent plane of the last foot
        n = normal(*foot.T)
        here = np.column_stack([foot, height(*foot.T)])
        off = np.sum((p - here) * n, axis=1, keepdims=True)
        foot = (p - off * n)[:, :2]
    n = normal(*foot.T)
    return np.sum((p - np.column_stack([foot, height(*foot.T)])) * n, axis=1)


def csv_text():
    """Return the shipped file."""
    lines = [
        "# 2,000 points of a panel of 0.5 m x 0.8 m as a scanner gives them, noise of 0.1 mm",
        "x,y,z",
        *("{:.4f},{:.4f},{:.4f}".format(*row) for row in 1e3 * scan()),
    ]
    return "\n".join(lines) + "\n"
