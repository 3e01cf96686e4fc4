"""Audit of guidance within virtual fixtures: rules and assumptions checked against the log."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario import Scenario
from experiments.results.feature import Feature
from experiments.results.guidance_feature import slots_of
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.controller.fixtures import free_motion
from reporting.metrics import Metrics

SLOT_WIDTH = 10  # index, h, n (3), u, beta, phi, stiffness, depth
_NEAR = 2e-3  # m, a region as close as this must not be missed
# ticks over which motion is compared, and m/s by which it has to change meanwhile, rms
_SPAN, _MOVED = 20, 2e-3
# of the lag, and s, that it may be wrong by
_SHARE, _LEAST = 0.3, 1e-3
# m, distance from a region that blocks the tool
_TIGHT = 1e-3


@dataclass(frozen=True)
class GuidanceRules:
    """Parameters of the guidance rules.

    Attributes:
        mass: m [kg].
        damping: d [N s/m]; None where a person may change it, so that the logged value counts.
        largest_speed: Largest speed of the free motion [m/s]; the log has times of a lower limit.
        capacity: Capacity of the tank [J].
        guides: Stiffness [N/m] and reach [m] of each attracting path.
    """

    mass: float
    damping: float | None
    largest_speed: float
    capacity: float
    guides: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class _Slots:
    """Logged data of near regions, by tick and slot."""

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


def audit(log: RunLog, rules: GuidanceRules) -> Metrics:
    """Return the largest violations of the guidance rules in a run.

    Args:
        log: Log of a run with fixtures, by the rules ``program``.
        rules: Parameters of the rules.

    Returns:
        ``audit_stationarity`` [m/s]: of ``(m + T d) v+ = m v + T f + T sum phi n``, with the d that
        limits the speed where it was limited; ``audit_allowance`` [m/s]: of ``n v+ >= u - beta``,
        and of equality where phi > 0; ``audit_energy`` [J]: energy gained beyond the inequality of
        a tick; ``audit_tank`` [J]: deviation from the tank's balance; ``audit_bound`` [J]: distance
        of the operator's work above its bound, negative below; ``audit_missed``: ticks at which a
        region within 2 mm was not evaluated.
    """
    metrics = Metrics()
    v, f = log["velocity_command"].values, log["guiding_force"].values
    known = np.asarray(np.isfinite(v).all(axis=1))
    if np.count_nonzero(known) < 2 or not known[: known.sum()].all():
        return metrics
    count = int(known.sum())
    v, f, T = v[:count], f[:count], log.period
    slots = _read(log["near_regions"].values[:count])
    before = np.vstack([np.zeros(3), v[:-1]])
    d = log["free_damping"].values[:count, 0]
    if rules.damping is not None:
        d = np.full(count, rules.damping)
    limit = np.minimum(log["speed_limit"].values[:count, 0], rules.largest_speed)
    kappa, offset, stored, stored_after = _guided(log, rules, count, T)
    momentum = rules.mass * before + T * (f + kappa[:, None] * offset)
    # a limit of speed is damping
    slowed = np.linalg.norm(momentum, axis=1) / np.maximum(limit, 1e-6)
    inertia = np.maximum(rules.mass + T * d + T**2 * kappa, slowed)
    d = (inertia - rules.mass) / T - T * kappa
    impulse = T * np.sum((slots.used * slots.phi)[..., None] * slots.n, axis=1)
    missed = v - (momentum + impulse) / inertia[:, None]
    metrics.add("audit_stationarity", float(np.max(np.linalg.norm(missed, axis=1))))
    metrics.add("audit_allowance", _allowance(v, slots))
    work = T * np.sum(f * v, axis=1)
    lost = T * d * np.sum(v * v, axis=1)
    out = np.where(slots.hard, np.maximum(0.0, -slots.beta), 0.0)
    supplied = T * np.sum(slots.used * slots.phi * (slots.u + out), axis=1)
    spring = (
        np.sum(np.where(slots.soft, slots.stiffness * np.maximum(slots.depth, 0) ** 2, 0), 1) / 2
    )
    pressed = np.divide(slots.phi, slots.stiffness, out=np.zeros_like(slots.phi), where=slots.soft)
    after = np.sum(np.where(slots.soft, slots.stiffness * pressed**2, 0.0), axis=1) / 2
    spring, after = spring + stored, after + stored_after
    kinetic = rules.mass / 2 * np.sum(v * v - before * before, axis=1)
    metrics.add("audit_energy", float(np.max(kinetic + after - spring - (work - lost + supplied))))
    tank = log["tank"].values[:count, 0]
    # energy gained by springs between ticks
    paid = spring - np.concatenate([[stored[0]], after[:-1]])
    expected = np.minimum(rules.capacity, tank[:-1] - supplied[:-1] + lost[:-1] - paid[:-1])
    metrics.add("audit_tank", float(np.max(np.abs(expected - tank[1:]), initial=0.0)))
    bound = -(tank[0] + spring[0])
    metrics.add("audit_bound", float(np.min(np.cumsum(work)) - bound))
    metrics.add("audit_missed", float(_missed(log, slots, count)))
    return metrics


def _guided(
    log: RunLog, rules: GuidanceRules, count: int, period: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return stiffness [N/m], offset [m], and energy before and after a tick [J] of guides."""
    none = np.zeros(count)
    if not rules.guides:
        return none, np.zeros((count, 3)), none, none
    active = log["guide"].values[:count, 0]
    share = log["guide_share"].values[:count, 0]
    k, R = np.array([(0.0, 1.0), *rules.guides])[active].T
    top = max(stiffness * reach**2 / 6.0 for stiffness, reach in rules.guides)
    closest_point, z = (log[name].values[:count] for name in ("guide_foot", "rest_point"))
    after = z + period * log["velocity_command"].values[:count]

    def inside(point: FloatArray) -> FloatArray:
        return np.maximum(1.0 - np.sum((point - closest_point) ** 2, axis=1) / R**2, 0.0)

    def energy(point: FloatArray) -> FloatArray:
        return np.asarray(share * (top - k * R**2 / 6.0 * inside(point) ** 3))

    kappa = np.asarray(share * k * inside(z) ** 2)
    return kappa, closest_point - z, energy(z), energy(after)


def _read(values: FloatArray) -> _Slots:
    slots = values.reshape(len(values), -1, SLOT_WIDTH)
    index, _, n, u, beta, phi, stiffness, depth = (
        slots[..., 0], slots[..., 1], slots[..., 2:5], *(slots[..., k] for k in range(5, 10))
    )  # fmt: skip
    return _Slots(index >= 0, index.astype(int), n, u, beta, phi, stiffness, depth)


def _allowance(v: FloatArray, slots: _Slots) -> float:
    speed = np.einsum("tsk,tk->ts", slots.n, v)
    slack = speed - (slots.u - slots.beta)
    active = slots.hard & (slots.phi > 0.0)
    broken = np.max(np.where(slots.hard, -slack, 0.0), initial=0.0)
    loose = np.max(np.where(active, np.abs(slack), 0.0), initial=0.0)
    return float(max(broken, loose))


def _missed(log: RunLog, slots: _Slots, count: int) -> int:
    """Return the number of ticks at which a region near the tool's rest point was not evaluated."""
    distance = log["region_distance"].values[:count]
    lag = np.linalg.norm(log["rest_point"].values[:count] - log["y_t"].values[:count], axis=1)
    missed = 0
    for region, h in enumerate(distance.T):
        evaluated = np.any(slots.used & (slots.index == region), axis=1)
        missed += int(np.count_nonzero((h + lag < _NEAR) & ~evaluated))
    return missed


def guidance_warnings(log: RunLog, settings: Scenario) -> list[str]:
    """Return violated assumptions of a run within fixtures, one sentence each.

    Args:
        log: Log of the run.
        settings: Its scenario.
    """
    if "squeezed" not in log or not log.time.size or settings.fixtures is None:
        return []
    return [*_squeezed(log), *_late_servos(log, settings)]


def observed_lag(log: RunLog, nominal: float) -> float | None:
    """Return the lag of velocity servos, from commanded and measured velocities [s].

    The rules use ``z = y + tau y' + T sum of pending commands``. With servos ``y'' = (v - y') /
    tau`` it moves by T v in a tick. Any further motion is the error of ``tau`` times the change of
    ``y'``.

    Args:
        log: Log of a run with the law ``velocity_servo``.
        nominal: ``tau`` [s].

    Returns:
        None where the tool hardly moved.
    """
    y = log["y_t_measured" if "y_t_measured" in log else "y_t"].values
    z, v = log["rest_point"].values, log["velocity_command"].values
    known = np.isfinite(v).all(axis=1)
    if np.count_nonzero(known) <= _SPAN:
        return None
    z, v, period = z[known], v[known], log.period
    # a command at a tick acts from the next tick on
    error = z - period * (np.cumsum(v, axis=0) - v)
    rate = np.gradient(y[known], period, axis=0)
    beside, change = (x[_SPAN:] - x[:-_SPAN] for x in (error, rate))
    if np.sqrt(np.mean(change**2)) < _MOVED:
        return None
    return nominal - float(np.sum(beside * change) / np.sum(change**2))


def _late_servos(log: RunLog, settings: Scenario) -> list[str]:
    fixtures, servo = settings.fixtures, settings.servo
    if fixtures is None or settings.controller.law_record.commands_torque:
        return []
    nominal = fixtures.lag_behind(servo.bandwidth)
    lag = observed_lag(log, nominal)
    if lag is None or abs(lag - nominal) <= max(_SHARE * nominal, _LEAST):
        return []
    least = 2.0 * (lag + servo.bus_delay)
    return [
        f"the tool follows the commanded velocity with a lag of {1e3 * lag:.2g} ms, not "
        f"{1e3 * nominal:.2g} ms as in fixtures.servo_lag (by default 1 / servo.bandwidth), and "
        "enters regions deeper: correct it, and set fixtures.guidance.approach_time to "
        f"{least:.2g} "
        "s or more"
    ]


def _squeezed(log: RunLog) -> list[str]:
    ticks = np.flatnonzero(log["squeezed"].values[:, 0] > 0.5)
    if not ticks.size:
        return []
    distance = log["region_distance"]
    period = log.period
    names = [
        name
        for i, name in enumerate(distance.labels or [])
        if np.any(_is_tight(slots_of(log, i))[ticks])
    ]
    deepest = -float(np.nanmin(distance.values[ticks], initial=0.0))
    return [
        f"{' and '.join(names)} squeezed the tool for {period * ticks.size:.3g} s from t = "
        f"{log.time[ticks[0]]:.3f} s on: no nearby position is outside all of them, and it was "
        f"up to {1e3 * deepest:.2g} mm inside one"
    ]


def _is_tight(slots: dict[str, FloatArray]) -> NDArray[np.bool_]:
    """Return when the tool was in a hard region or close to it, shape (samples,)."""
    return (slots["stiffness"] == 0.0) & (slots["h"] < _TIGHT)


def _guidance_audit(log: RunLog, settings: Scenario) -> Metrics:
    """Audit forbidden regions, if there are any."""
    fixtures = settings.fixtures
    if fixtures is None or "near_regions" not in log:
        return Metrics()
    motion = free_motion(settings.compliance, settings.controller.sampling_time)
    guidance = fixtures.guidance
    guides = tuple((guide.stiffness, guide.reach) for guide in fixtures.guides)
    damping = motion.damping if settings.operator is None else None
    numbers = motion.mass, damping, guidance.largest_speed, guidance.tank.capacity, guides
    return audit(log, GuidanceRules(*numbers))


FEATURE = Feature(
    metrics=lambda log, station, settings: _guidance_audit(log, settings),
    warnings=lambda log, station, settings: guidance_warnings(log, settings),
)
