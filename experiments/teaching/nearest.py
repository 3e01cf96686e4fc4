"""The nearest place on a line of samples."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from experiments.results.run_log import FloatArray


@dataclass(frozen=True)
class Nearest:
    """Where on a line of samples points are nearest.

    Attributes:
        distances: From it [m], shape (n,).
        samples: The sample before that place, shape (n,).
        shares: Of the way from there to the next sample, shape (n,).
    """

    distances: FloatArray
    samples: np.ndarray
    shares: FloatArray

    def at(self, values: FloatArray) -> FloatArray:
        """Return values at the samples, interpolated there, shape (n, ..)."""
        shares = self.shares.reshape(-1, *[1] * (values.ndim - 1))
        after = np.minimum(self.samples + 1, len(values) - 1)
        return values[self.samples] + shares * (values[after] - values[self.samples])


def nearest_on_line(points: FloatArray, line: FloatArray) -> Nearest:
    """Return where points are nearest to a line of samples.

    It is on one of the two sides that meet in the nearest sample, which it is wherever the sides
    are short beside the line's bends.

    Args:
        points: Finite [m], shape (n, 3).
        line: Finite [m], shape (k, 3), k > 0; neighbours may coincide.
    """
    # the last of each run of samples that coincide
    apart = np.flatnonzero(np.append(np.any(np.diff(line, axis=0), axis=1), True))
    line = line[apart]
    _, corner = cKDTree(line).query(points)
    best = Nearest(np.linalg.norm(points - line[corner], axis=1), corner, np.zeros(len(points)))
    distances, samples, shares = best.distances, best.samples, best.shares
    for shift in (-1, 0):
        side = np.clip(corner + shift, 0, max(len(line) - 2, 0))
        way = line[np.minimum(side + 1, len(line) - 1)] - line[side]
        square = np.sum(way**2, axis=1)
        along = np.sum((points - line[side]) * way, axis=1) / np.where(square, square, 1.0)
        share = np.clip(along, 0.0, 1.0)
        distance = np.linalg.norm(points - line[side] - share[:, None] * way, axis=1)
        closer = distance < distances
        distances = np.where(closer, distance, distances)
        samples, shares = np.where(closer, side, samples), np.where(closer, share, shares)
    return Nearest(distances, apart[samples], shares)
