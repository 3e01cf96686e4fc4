"""Forces over time, written down beforehand."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError

FRAMES = ("world", "manifold")


def smooth_step(x: Any) -> Any:
    """Return ``10 x^3 - 15 x^4 + 6 x^5``, 0 before x = 0 and 1 after x = 1; C^2."""
    x = ca.fmin(ca.fmax(x, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


def smooth_step_slope(x: Any) -> Any:
    """Return the derivative of :func:`smooth_step`."""
    x = ca.fmin(ca.fmax(x, 0.0), 1.0)
    return 30.0 * x * x * (1.0 - x) * (1.0 - x)


def smooth_pulse(time: Any, begin: float, end: float, ramp: float) -> Any:
    """Return 1 from ``begin + ramp`` to ``end - ramp``, 0 outside ``begin .. end``; C^2."""
    return ca.fmin(smooth_step((time - begin) / ramp), smooth_step((end - time) / ramp))


def require_vector(key: str, value: np.ndarray) -> np.ndarray:
    """Return three numbers as an array, shape (3,).

    Args:
        key: For the message.
        value: What was given.

    Raises:
        InputError: If it is anything else.
    """
    vector = np.asarray(value, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise InputError(f"{key} = {vector.tolist()}: must be 3 finite numbers")
    return vector


@dataclass
class ForcePulse:
    """A wrench on the robot that comes, stays and goes, smoothly (C^2 in time).

    Attributes:
        begin: When it leaves zero [s].
        end: When it is zero again [s].
        force: In between, shape (3,) [N].
        torque: In between, shape (3,) [Nm].
        ramp: Time from zero to full and back [s].
        frame: ``world``: components along the world's axes; ``manifold``: along
            ``e_par, e_perp, e_cross`` of the path next to the tool, so that
            ``force = [-100, 0, 0]`` pushes against a motion with growing ``eta``.
        link: Link or frame of the robot's model that it acts on; empty for the tool.
        point: Where, in the axes of that link or frame [m], shape (3,).
    """

    begin: float = 0.0
    end: float = 1.0
    force: np.ndarray = field(default_factory=lambda: np.zeros(3))
    torque: np.ndarray = field(default_factory=lambda: np.zeros(3))
    ramp: float = 0.05
    frame: str = "world"
    link: str = ""
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        for key in ("force", "torque", "point"):
            setattr(self, key, require_vector(key, getattr(self, key)))
        if not self.link and self.point.any():
            raise InputError(f"point = {self.point.tolist()}: must be [0, 0, 0] without a link")
        if not (np.isfinite(self.begin) and self.begin < self.end < np.inf):
            raise InputError(f"begin, end = {self.begin}, {self.end}: must be finite and ascending")
        longest = (self.end - self.begin) / 2.0
        if not 0.0 < self.ramp <= longest * (1.0 + 1e-9):
            raise InputError(
                f"ramp = {self.ramp}: must be positive and at most {longest:g}, half the pulse"
            )
        if self.frame not in FRAMES:
            raise InputError(f"frame = {self.frame!r}: must be one of {', '.join(FRAMES)}")

    def at(self, time: Any) -> Any:
        """Return ``[force, torque]`` in the pulse's own frame, shape (6,) [N, Nm].

        Args:
            time: [s].
        """
        scale = smooth_pulse(time, self.begin, self.end, self.ramp)
        return scale * ca.DM(np.concatenate([self.force, self.torque]))


class ForceProfile:
    """A sum of pulses at one point.

    Args:
        pulses: The pulses; they may overlap, and so make stairs.
    """

    def __init__(self, pulses: Sequence[ForcePulse]) -> None:
        self._by_frame = {
            frame: [pulse for pulse in pulses if pulse.frame == frame] for frame in FRAMES
        }

    @property
    def needs_manifold(self) -> bool:
        """Whether a pulse is given in manifold coordinates."""
        return bool(self._by_frame["manifold"])

    def at(self, time: Any, axes: Any) -> Any:
        """Return the wrench in world axes, shape (6,) [N, Nm].

        Args:
            time: [s].
            axes: Directions of the frame ``manifold`` as columns, shape (3, 3).
        """
        sums = {
            frame: ca.reshape(sum((p.at(time) for p in pulses), ca.DM.zeros(6)), 3, 2)
            for frame, pulses in self._by_frame.items()
        }
        return ca.vec(sums["world"] + axes @ sums["manifold"])
