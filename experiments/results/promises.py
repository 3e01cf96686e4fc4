"""What a run promises: targets checked before it, which of them it broke.

A promise is a metric with a target that can be compared: those that a scenario names in
``targets``, and those that every run makes. They are measured on the truth, not on what the
controller believes or asks for.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.drives import DriveLimitsOfRun, plan_metrics
from experiments.results.path import shape_metrics
from experiments.results.posture import is_redundant
from experiments.results.rest import set_rest_targets
from experiments.results.run_log import FloatArray, RunLog
from experiments.results.run_signals import expected_signals
from pfsc_drake.errors import InputError, did_you_mean
from reporting.metrics import Metric, Metrics, format_quantity
from reporting.registry import possible_metrics

# held at every instant, so that also a run that was cut short is judged by them
_ALWAYS = (
    *("deepest_violation", "max_unanswered_force", "past_known_way"),
    *("least_port_tank", "energy_margin", "least_distance_while_moving"),
    *("motion_after_fault", "slide_motion_after_fault"),
)
# metrics that only grow while a run lasts, or only fall, by how their names begin
_GROWING = (
    *("max_", "peak_", "largest_", "deepest_", "audit_", "rest_", "joint_velocity_share"),
    *("limit_reversals", "saturated_samples", "clipped_ticks", "missed_ticks", "waited_time"),
)
_FALLING = ("least_", "joint_limit_margin", "slide_limit_margin")
# errors of the last sample, the worst of all axes
_OF_THE_END = ("max_coulomb_error", "max_viscous_error")
# m, by which a tool may be past the end of what it knows of its path: it follows its reference
_PAST = 1e-3
# m, that leader and follower may be apart in the end because energy lacks to tell it
_OWED = 1e-3
# how far a tool is from where it should be, the first of them that a run has, and from when on
# that is worth a word [m]
_DISTANCES = ("max_error_from_compliant_reference", "max_path_deviation")
_WORTH_A_WORD = 1e-3
# signals that another law may log on the same robot
_OF_OTHER_LAWS = {"xi_M", "eta_dot", "tau_d"}
# signals of an orientation, which may be no task
_OF_ORIENTATIONS = {"phi"}
# signals of an observer, which may be left out
_OF_OBSERVERS = {"tau_f", "friction_estimate", "f_c", "f_c_estimate", "f_v", "f_v_estimate"}

# signals of a leader, which may be in another process
_OF_LEADERS = {"led_point"}


def check_targets(settings: Scenario, station: Station) -> None:
    """Refuse targets for metrics that a run with their law would not have.

    Args:
        settings: The scenario.
        station: Its station.

    Raises:
        InputError: One line that names law, metric and the metrics that there are.
    """
    if not settings.targets:
        return
    task, surface = station.task, settings.surface
    signals = expected_signals(station) | _OF_OBSERVERS
    if settings.path.orientation.task == "none" or (surface and surface.orientation.kind == "none"):
        signals |= _OF_ORIENTATIONS
    if settings.teleoperation is not None:
        signals |= _OF_LEADERS
    properties = {"redundant": is_redundant(station), "closed": task.lap is not None}
    known = {
        *signals,
        *(name for name, is_so in properties.items() if is_so),
        *shape_metrics(task.shape, task.fit),
        *plan_metrics(task.drive_plan),
        *DriveLimitsOfRun.of(station.robot).metric_names(),
    }
    for law, targets in settings.targets.items():
        other = set() if law == settings.controller.law else _OF_OTHER_LAWS
        allowed = possible_metrics(known | other, station.robot.dimension)
        for name in targets:
            if name not in allowed:
                raise InputError(
                    f"targets.{law}.{name}: no such metric; {did_you_mean(name, allowed)}"
                    f"allowed: {', '.join(allowed)}"
                )


def set_promises(metrics: Metrics, settings: Scenario) -> None:
    """Give metrics their targets: what every run promises, then what the scenario says.

    Args:
        metrics: Metrics of the run.
        settings: Its scenario.
    """
    if settings.fixtures is not None and "deepest_violation" in metrics:
        bound = f"<= {settings.fixtures.bound:g}"
        metrics.set_target("deepest_violation", bound, "fixtures.bound")
    if settings.obstacles is not None and "least_distance_while_moving" in metrics:
        bound = f">= {settings.obstacles.watch.margin:g}"
        metrics.set_target("least_distance_while_moving", bound, "obstacles.watch.margin")
    set_rest_targets(metrics)
    if settings.compliance.needs_sensor and "max_unanswered_force" in metrics:
        # what is less would be taken for a bias
        bound = f"<= {settings.sensor.taring_spread[:3].max():g}"
        metrics.set_target("max_unanswered_force", bound, "sensor.taring_spread")
    way = settings.teleoperation
    for name in ("least_port_tank", "energy_margin"):
        if way is not None and way.passive and name in metrics:
            metrics.set_target(name, ">= 0", "teleoperation.passive")
    if way is not None and "owed_distance_end" in metrics:
        metrics.set_target("owed_distance_end", f"<= {_OWED:g}", "leader and follower meet")
    if settings.faults.chatter_turns > 0.0 and "limit_reversals" in metrics:
        bound = f"< {settings.faults.chatter_turns:g}"
        metrics.set_target("limit_reversals", bound, "faults.chatter_turns")
    if "past_known_way" in metrics:
        metrics.set_target("past_known_way", f"<= {_PAST:g}", "room to stop")
    for name, target in settings.targets.get(settings.controller.law, {}).items():
        # what another choice of the controller would tell has been checked, and is no metric here
        if name in metrics:
            metrics.set_target(name, target.bound, target.source)


def broken_promises(metrics: Metrics) -> list[str]:
    """Return what was promised and not kept, one phrase each.

    Args:
        metrics: With their targets. One without a value has missed its target, unless it is
            not judged.
    """
    return [
        _phrase(name, metric)
        for name, metric in metrics.items()
        if metric.passed is False and metric.judged
    ]


def leave_unjudged(metrics: Metrics, *, fault: bool) -> None:
    """Take back the verdict on metrics for which a run that was cut short is too short.

    It is judged by what holds at every instant, and by extremes that have passed their bound:
    nothing that follows could mend them. After a fault the tool does not follow its reference,
    so that extremes do not count.

    Args:
        metrics: With their targets.
        fault: Whether a fault cut it short.
    """
    for name, metric in metrics.items():
        if metric.bound is not None:
            at_all_times = name in _ALWAYS and not math.isnan(metric.value)
            extreme = not fault and _is_exceeded_extreme(name, metric)
            metric.judged = at_all_times or extreme


def _is_exceeded_extreme(name: str, metric: Metric) -> bool:
    """Whether a metric has passed a bound that it cannot come back to."""
    assert metric.bound is not None
    begins = _GROWING if metric.bound[0].startswith("<") else _FALLING
    extreme = name.startswith(begins) and name not in _OF_THE_END
    return extreme and metric.passed is False and not math.isnan(metric.value)


def unpromised_distance(metrics: Metrics, law: str) -> list[str]:
    """Return what there is to say of a tool that was far from where no target wants it nearer.

    Args:
        metrics: With their targets.
        law: That moved the tool.
    """
    name = next((name for name in _DISTANCES if name in metrics), None)
    if name is None or metrics[name].target is not None or not metrics[name].value > _WORTH_A_WORD:
        return []
    far = format_quantity(metrics[name].value, "m")
    return [
        f"the tool was up to {far} from where it should be ({name}), and no target says whether "
        f"that is too far: with targets: {{{law}: {{{name}: {{bound: '< 1e-3'}}}}}} such a run "
        "ends with status 3"
    ]


def _phrase(name: str, metric: Metric) -> str:
    """Return what was missed, with its target."""
    assert metric.bound is not None
    comparison, number = metric.bound
    target = f"target {comparison} {format_quantity(number, metric.unit)}"
    if math.isnan(metric.value):
        return f"{name} has no value, {target}"
    why = f" ({metric.source})" if name == "arrived" and metric.source else ""
    return f"{name} = {format_quantity(metric.value, metric.unit)}, {target}{why}"


SLOT_WIDTH = 10  # index, h, n (3), u, beta, phi, stiffness, depth
_NEAR = 2e-3  # m, a region as close as this must not be missed


@dataclass(frozen=True)
class GuidanceRules:
    """Numbers that the rules were given.

    Attributes:
        mass: m [kg].
        damping: d [N s/m]; None where a person may change it, so that the log's counts.
        largest_speed: Largest speed of the free motion [m/s]; the log tells where it was lower.
        capacity: Capacity of the tank [J].
        guides: Stiffness [N/m] and reach [m] of each path that attracts.
    """

    mass: float
    damping: float | None
    largest_speed: float
    capacity: float
    guides: tuple[tuple[float, float], ...] = ()


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


def audit(log: RunLog, promise: GuidanceRules) -> Metrics:
    """Return by how much, at worst, a run breaks what was promised.

    Args:
        log: Log of a run with fixtures, by the rules ``program``.
        promise: Numbers that the rules were given.

    Returns:
        ``audit_stationarity`` [m/s]: of ``(m + T d) v+ = m v + T f + T sum phi n``, d being what
        limits the speed where it was limited;
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
    pulled = _guided(log, promise, count, T)
    momentum = promise.mass * before + T * (f + pulled.kappa[:, None] * pulled.way)
    # a limit of speed is damping
    slowed = np.linalg.norm(momentum, axis=1) / np.maximum(limit, 1e-6)
    inertia = np.maximum(promise.mass + T * d + T**2 * pulled.kappa, slowed)
    d = (inertia - promise.mass) / T - T * pulled.kappa
    held = T * np.sum((slots.used * slots.phi)[..., None] * slots.n, axis=1)
    missed = v - (momentum + held) / inertia[:, None]
    metrics.add("audit_stationarity", float(np.max(np.linalg.norm(missed, axis=1))))
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
    spring, after = spring + pulled.energy, after + pulled.energy_after
    kinetic = promise.mass / 2 * np.sum(v * v - before * before, axis=1)
    metrics.add("audit_energy", float(np.max(kinetic + after - spring - (work - lost + given))))
    tank = log["tank"].values[:count, 0]
    # what springs gain between ticks
    paid = spring - np.concatenate([[pulled.energy[0]], after[:-1]])
    expected = np.minimum(promise.capacity, tank[:-1] - given[:-1] + lost[:-1] - paid[:-1])
    metrics.add("audit_tank", float(np.max(np.abs(expected - tank[1:]), initial=0.0)))
    bound = -(tank[0] + spring[0])
    metrics.add("audit_bound", float(np.min(np.cumsum(work)) - bound))
    metrics.add("audit_missed", float(_missed(log, slots, count)))
    return metrics


@dataclass(frozen=True)
class _Pulled:
    """What guides do at each tick, from where the tool is pulled to and their numbers."""

    kappa: FloatArray
    way: FloatArray
    energy: FloatArray
    energy_after: FloatArray


def _guided(log: RunLog, promise: GuidanceRules, count: int, period: float) -> _Pulled:
    """Return what guides do [N/m, m, J], by their law."""
    none = np.zeros(count)
    if not promise.guides:
        return _Pulled(none, np.zeros((count, 3)), none, none)
    active = log["guide"].values[:count, 0]
    share = log["guide_share"].values[:count, 0]
    k, R = np.array([(0.0, 1.0), *promise.guides])[active].T
    top = max(stiffness * reach**2 / 6.0 for stiffness, reach in promise.guides)
    foot, z = (log[name].values[:count] for name in ("guide_foot", "rest_point"))
    after = z + period * log["velocity_command"].values[:count]

    def inside(point: FloatArray) -> FloatArray:
        return np.maximum(1.0 - np.sum((point - foot) ** 2, axis=1) / R**2, 0.0)

    def energy(point: FloatArray) -> FloatArray:
        return np.asarray(share * (top - k * R**2 / 6.0 * inside(point) ** 3))

    kappa = np.asarray(share * k * inside(z) ** 2)
    return _Pulled(kappa, foot - z, energy(z), energy(after))


def _read(values: FloatArray) -> _Slots:
    slots = values.reshape(len(values), -1, SLOT_WIDTH)
    index, _, n, u, beta, phi, stiffness, depth = (
        slots[..., 0], slots[..., 1], slots[..., 2:5], *(slots[..., k] for k in range(5, 10))
    )  # fmt: skip
    return _Slots(index >= 0, index.astype(int), n, u, beta, phi, stiffness, depth)


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
