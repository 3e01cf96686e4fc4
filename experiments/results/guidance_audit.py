"""Checks what was promised of forbidden regions, from a log alone, sharing no code with the rules.

Every formula stands here once more, on arrays of the whole run. The names are those of the log:
v the asked velocity, f the force that a tick went by, and of each near region its distance h,
normal n, speed u, allowance beta, force phi, stiffness (0: hard) and depth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics

SLOT_WIDTH = 10  # index, h, n (3), u, beta, phi, stiffness, depth
_NEAR = 2e-3  # m, a region as close as this must not be missed


@dataclass(frozen=True)
class Promise:
    """Numbers that the rules were given.

    Attributes:
        mass: m [kg].
        damping: d [N s/m]; None where a person may change it, so that the log's counts.
        largest_speed: Of the free motion [m/s]; the log tells where it was lower.
        capacity: Of the tank [J].
    """

    mass: float
    damping: float | None
    largest_speed: float
    capacity: float


@dataclass(frozen=True)
class _Slots:
    """What the log tells of near regions, by tick and slot."""

    used: NDArray[np.bool_]
    index: NDArray[np.int_]
    n: FloatArray
    u: FloatArray
    beta: FloatArray
    phi: FloatArray
    stiffness: FloatArray
    depth: FloatArray

    @property
    def hard(self) -> NDArray[np.bool_]:
        return self.used & (self.stiffness == 0.0)

    @property
    def soft(self) -> NDArray[np.bool_]:
        return self.used & (self.stiffness > 0.0)


def audit(log: RunLog, promise: Promise) -> Metrics:
    """Return by how much, at worst, a run breaks what was promised.

    Args:
        log: Of a run with fixtures, by the rules ``program``.
        promise: Numbers that the rules were given.

    Returns:
        ``audit_stationarity`` [m/s]: of ``(m + T d)(v+ - v*) = T sum phi n``;
        ``audit_allowance`` [m/s]: of ``n v+ >= u - beta``, and of equality where phi > 0;
        ``audit_energy`` [J]: gained beyond the inequality of a tick; ``audit_tank`` [J]: beside the
        tank's law; ``audit_bound`` [J]: how far the hand's work stays above its bound, negative if
        it does not; ``audit_missed``: ticks at which a region within 2 mm was not looked at.
    """
    metrics = Metrics()
    v, f = log["velocity_command"].values, log["guiding_force"].values
    known = np.asarray(np.isfinite(v).all(axis=1))
    if np.count_nonzero(known) < 2 or not known[: known.sum()].all():
        return metrics
    count = int(known.sum())
    v, f, T = v[:count], f[:count], float(np.median(np.diff(log.time)))
    slots = _read(log["near_regions"].values[:count])
    before = np.vstack([np.zeros(3), v[:-1]])
    d = log["free_damping"].values[:count, 0]
    if promise.damping is not None:
        d = np.full(count, promise.damping)
    limit = np.minimum(log["speed_limit"].values[:count, 0], promise.largest_speed)
    inertia = (promise.mass + T * d)[:, None]
    free = (promise.mass * before + T * f) / inertia
    metrics.add("audit_stationarity", _stationarity(v, free, limit, slots, T / inertia))
    metrics.add("audit_allowance", _allowance(v, slots))
    work = T * np.sum(f * v, axis=1)
    lost = T * d * np.sum(v * v, axis=1)
    out = np.where(slots.hard, np.maximum(0.0, -slots.beta), 0.0)
    given = T * np.sum(slots.used * slots.phi * (slots.u + out), axis=1)
    spring = (
        np.sum(np.where(slots.soft, slots.stiffness * np.maximum(slots.depth, 0) ** 2, 0), 1) / 2
    )
    pressed = np.divide(slots.phi, slots.stiffness, out=np.zeros_like(slots.phi), where=slots.soft)
    after = np.sum(np.where(slots.soft, slots.stiffness * pressed**2, 0.0), axis=1) / 2
    kinetic = promise.mass / 2 * np.sum(v * v - before * before, axis=1)
    metrics.add("audit_energy", float(np.max(kinetic + after - spring - (work - lost + given))))
    tank = log["tank"].values[:count, 0]
    # what springs gain between ticks
    paid = spring - np.concatenate([[0.0], after[:-1]])
    expected = np.minimum(promise.capacity, tank[:-1] - given[:-1] + lost[:-1] - paid[:-1])
    metrics.add("audit_tank", float(np.max(np.abs(expected - tank[1:]), initial=0.0)))
    bound = -(tank[0] + spring[0])
    metrics.add("audit_bound", float(np.min(np.cumsum(work)) - bound))
    metrics.add("audit_missed", float(_missed(log, slots, count)))
    return metrics


def _read(values: FloatArray) -> _Slots:
    slots = values.reshape(len(values), -1, SLOT_WIDTH)
    index, _, n, u, beta, phi, stiffness, depth = (
        slots[..., 0], slots[..., 1], slots[..., 2:5], *(slots[..., k] for k in range(5, 10))
    )  # fmt: skip
    return _Slots(index >= 0, index.astype(int), n, u, beta, phi, stiffness, depth)


def _stationarity(
    v: FloatArray, free: FloatArray, limit: FloatArray, slots: _Slots, mobility: FloatArray
) -> float:
    size = np.linalg.norm(free, axis=1)
    wanted = free * np.minimum(1.0, limit / np.maximum(size, 1e-12))[:, None]
    held = mobility * np.sum((slots.used * slots.phi)[..., None] * slots.n, axis=1)
    return float(np.max(np.linalg.norm(v - wanted - held, axis=1)))


def _allowance(v: FloatArray, slots: _Slots) -> float:
    speed = np.einsum("tsk,tk->ts", slots.n, v)
    room = speed - (slots.u - slots.beta)
    held = slots.hard & (slots.phi > 0.0)
    broken = np.max(np.where(slots.hard, -room, 0.0), initial=0.0)
    loose = np.max(np.where(held, np.abs(room), 0.0), initial=0.0)
    return float(max(broken, loose))


def _missed(log: RunLog, slots: _Slots, count: int) -> int:
    """Return at how many ticks a region was near the tool's rest point, but not looked at."""
    distance = log["region_distance"].values[:count]
    lag = np.linalg.norm(log["rest_point"].values[:count] - log["y_t"].values[:count], axis=1)
    missed = 0
    for region, h in enumerate(distance.T):
        seen = np.any(slots.used & (slots.index == region), axis=1)
        missed += int(np.count_nonzero((h + lag < _NEAR) & ~seen))
    return missed
