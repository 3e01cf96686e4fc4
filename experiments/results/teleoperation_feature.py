"""Teleoperation: signals of leader and ports, tracking of the leader, audit of the energy."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.scenario import Scenario, Target
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.teleoperation.port import RECORD, SIDES, TURNING_RECORD
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AXES = ("x", "y", "z")
_LONGEST = 1.5  # s, largest delay that is tried
_OWED = 1e-3  # m, allowed final distance of leader and follower due to missing energy
_ALWAYS = ("least_port_tank", "energy_margin")
_STEP = 4  # ticks between tried delays


def add_teleoperation(log: RunLog, _station: Station | None, raw: Raw) -> None:
    """Add signals of leader, channel and both ports.

    Args:
        log: Log of the run, which is extended.
        _station: The station, unused.
        raw: Its logged signals.
    """
    here = [side for side in SIDES if f"{side}_record" in raw]
    if not here:
        return
    if "leader" in here:
        log.add("leader_position", raw["leader_state"][:, :3])
        log.add("leader_hand", raw["leader_hand"][:, :3])
        log.add("leader_force", raw["leader_motor"])
        log.add("led_point", raw["led_point"])
    turns = raw[f"{here[0]}_record"].shape[1] > RECORD["share"].stop
    if turns and "leader" in here:
        log.add("leader_orientation", raw["wrist_state"][:, :9])
        log.add("leader_hand_moment", raw["leader_hand"][:, 3:])
        log.add("leader_moment", raw["wrist_motor"])
        log.add("led_orientation", raw["led_orientation"])
    for name, rows in (RECORD | (TURNING_RECORD if turns else {})).items():
        size = rows.stop - rows.start
        sides = [raw[f"{side}_record"][:, rows] for side in here]
        axes = _AXES if size > 1 else ("",)
        labels = [f"{side} {axis}".strip() for side in here for axis in axes]
        log.add(f"port_{name}", np.hstack(sides), labels=labels)


def teleoperation_metrics(log: RunLog, settings: Scenario) -> Metrics:
    """Return tracking of a teleoperated tool, and the audit of its energy.

    Args:
        log: Log of a run.
        settings: Its scenario.

    Returns:
        ``following_delay`` [s] and ``following_error`` [m]: delay of best tracking, and rms error
        with it; ``led_distance_end`` [m]: final distance of leader and follower;
        ``owed_distance_end`` [m]: part of it that a side could not transmit for lack of energy;
        ``largest_handle_speed`` [m/s]; ``largest_felt_force`` [N]; ``least_port_tank`` [J];
        ``energy_margin`` [J]: actual work of operator and environment plus initial stored energy,
        minimum; with six axes ``led_turn_end`` [rad] and ``largest_felt_moment`` [Nm], and moments
        do work, too; ``audit_ports`` [J]: deviation from the balance of the tanks;
        ``audit_channel`` [J]: energy received beyond the energy sent. For a follower whose leader
        is another process, only metrics of its own tank.
    """
    metrics = Metrics()
    coupling = settings.teleoperation
    if coupling is None or "port_force" not in log or log.time.size < 2:
        return metrics
    metrics.add("least_port_tank", float(log["port_tank"].values.min()))
    metrics.add("owed_distance_end", float(log["port_owed"].values[-1].max()))
    metrics.add(
        "audit_ports", tank_residual(log, coupling.tank.capacity if coupling.passive else np.inf)
    )
    if "led_point" not in log:
        return metrics
    delay, error = _following(log)
    metrics.add("following_delay", delay)
    metrics.add("following_error", error)
    apart = log["led_point"].values[-1] - log["y_t"].values[-1]
    metrics.add("led_distance_end", float(np.linalg.norm(apart)))
    metrics.add("largest_handle_speed", handle_speed(log))
    felt = log.norm("leader_force")
    metrics.add("largest_felt_force", float(felt.max()))
    if "led_orientation" in log:
        ends = (log[name].values[-1:].reshape(-1, 3, 3) for name in ("R_e", "led_orientation"))
        metrics.add("led_turn_end", float(np.linalg.norm(turns_between(*ends))))
        moment = log.norm("leader_moment")
        metrics.add("largest_felt_moment", float(moment.max()))
    scale = coupling.motion_scale / coupling.force_scale
    metrics.add("energy_margin", float(energy_above_bound(log, scale).min()))
    metrics.add("audit_channel", float(np.max(-stored_in_channel(log), initial=0.0)))
    return metrics


def handle_speed(log: RunLog) -> float:
    """Return the largest speed of the leader's handle from sample to sample [m/s].

    Args:
        log: With ``leader_position``, of two samples at least.
    """
    steps = np.linalg.norm(np.diff(log["leader_position"].values, axis=0), axis=1)
    return float(np.max(steps / np.diff(log.time)))


def handle_warnings(log: RunLog, settings: Scenario) -> list[str]:
    """Return a warning if the handle was faster than its parameter.

    Args:
        log: Log of a run.
        settings: Its scenario.
    """
    coupling = settings.teleoperation
    if coupling is None or "leader_position" not in log or log.time.size < 2:
        return []
    speed, largest = handle_speed(log), coupling.leader.largest_speed
    if speed <= largest:
        return []
    return [
        f"the handle moved at up to {speed:.3g} m/s, faster than teleoperation.leader.largest_speed"
        f" = {largest:g} m/s: a force may take more energy in a sample than the leader's reserve "
        "holds, and its tank may be negative until this is compensated"
    ]


def _following(log: RunLog) -> tuple[float, float]:
    """Return the delay of best tracking [s], and the rms error with it [m]."""
    commanded, tool = log["led_point"].values, log["y_t"].values
    period = log.period
    longest = min(round(_LONGEST / period), len(tool) // 2)
    delays = range(0, max(longest, 1), _STEP)
    errors = [
        float(np.sqrt(np.mean(np.sum((commanded[: len(commanded) - d] - tool[d:]) ** 2, axis=1))))
        for d in delays
    ]
    best = int(np.argmin(errors))
    return delays[best] * period, errors[best]


def works(log: RunLog) -> FloatArray:
    """Return the accumulated work of each port's force [J], shape (samples, sides).

    Args:
        log: Log of a run.
    """
    force, position = (log[f"port_{name}"].values for name in ("force", "position"))
    steps = force[:-1] * np.diff(position, axis=0)
    done = steps.reshape(len(steps), -1, 3).sum(axis=2)
    if "port_turn" in log:
        moment, turn = (log[f"port_{name}"].values for name in ("moment", "turn"))
        R = Rotation.from_rotvec(turn.reshape(-1, 3)).as_matrix().reshape(len(turn), -1, 3, 3)
        done += np.sum(
            moment[:-1].reshape(len(steps), -1, 3) * turns_between(R[:-1], R[1:]), axis=2
        )
    return np.vstack([np.zeros(done.shape[1]), np.cumsum(done, axis=0)])


def energy_above_bound(log: RunLog, scale: float) -> FloatArray:
    """Return the actual work on both ends plus initial stored energy [J], shape (samples,).

    Args:
        log: Log of a run.
        scale: Ratio of work at follower and leader, motion scale by force scale.
    """
    hand = log["leader_hand"].values[:-1] * np.diff(log["leader_position"].values, axis=0)
    total = scale * hand.sum(axis=1)
    if "leader_orientation" in log:
        total += scale * _turning(log, "leader_hand_moment", "leader_orientation")
    if "wrench_ext" in log:
        total += _touching(log)
    stored = float(log["port_tank"].values[0].sum())
    if "tank" in log:
        stored += float(log["tank"].values[0, 0])
    return stored + np.concatenate([[0.0], np.cumsum(total)])


def _touching(log: RunLog) -> FloatArray:
    """Return the work of the environment on the tool at each tick [J], shape (samples - 1,)."""
    wrench, y_t = log["wrench_ext"].values[:-1], log["y_t"].values
    R = log["R_e"].values.reshape(-1, 3, 3)
    moved = np.hstack([np.diff(y_t, axis=0), turns_between(R[:-1], R[1:])])
    return np.asarray(np.sum(wrench * moved, axis=1))


def _turning(log: RunLog, moment: str, orientation: str) -> FloatArray:
    """Return the work of a sampled moment at each tick [J], shape (samples - 1,)."""
    R = log[orientation].values.reshape(-1, 3, 3)
    steps = log[moment].values[:-1] * turns_between(R[:-1], R[1:])
    return np.asarray(steps.sum(axis=1))


def turns_between(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return rotation vectors between rotations, shape (.., 3) [rad].

    Args:
        before: Shape (.., 3, 3).
        after: Shape (.., 3, 3); NaN gives NaN.
    """
    turned = (after @ np.swapaxes(before, -1, -2)).reshape(-1, 3, 3)
    known = np.isfinite(turned).all(axis=(1, 2))
    vectors = np.full((len(turned), 3), np.nan)
    vectors[known] = Rotation.from_matrix(turned[known]).as_rotvec()
    return np.asarray(vectors.reshape(*before.shape[:-2], 3))


def stored_in_channel(log: RunLog) -> FloatArray:
    """Return the energy in transit from each side [J], leader's first, shape (samples, 2).

    Args:
        log: Log of a run.
    """
    sent, received = log["port_sent"].values, log["port_received"].values
    return np.asarray(sent - received[:, ::-1])


def tank_residual(log: RunLog, capacity: float) -> float:
    """Return the largest deviation from the energy balance of the tanks [J].

    Args:
        log: Log of a run.
        capacity: Capacity of a tank [J].
    """
    tank, sent, received = (log[f"port_{name}"].values for name in ("tank", "sent", "received"))
    work = np.diff(works(log), axis=0)
    before = tank[:-1] - work + np.diff(received, axis=0)
    expected = np.minimum(before, capacity) - np.diff(sent, axis=0)
    return float(np.max(np.abs(expected - tank[1:]), initial=0.0))


def draw_teleoperation(log: RunLog) -> style.Drawing:
    """Draw commanded and actual motion of the tool, their distance, and forces of both sides."""
    canvas, (travel, apart, force) = style.make_panels(3)
    commanded, tool = log["led_point"].values, log["y_t"].values
    _plot_axes(travel, log.time, tool - tool[0], commanded - commanded[0])
    travel.set(title="Displacement of tool and leader (dashed)", ylabel="displacement in m")
    distance = np.linalg.norm((commanded - commanded[0]) - (tool - tool[0]), axis=1)
    apart.plot(log.time, 1e3 * distance, color="C0")
    apart.set(title="Distance of leader and tool", ylabel="distance in mm")
    _plot_sizes(force, log, "force", "on the tool")
    force.set(title="Forces", ylabel="force in N")
    style.add_legend(travel)
    style.add_legend(force)
    caption = (
        "Displacements since the start in the follower's scale. A static force displaces the "
        "leader "
        "by force times delay over wave impedance."
    )
    return style.Drawing("teleoperation", "Teleoperation", caption, canvas)


def draw_leader_turns(log: RunLog) -> style.Drawing:
    """Draw commanded and actual orientation of the tool, and moments of both sides."""
    canvas, (turn, apart, moment) = style.make_panels(3)
    commanded, tool = (log[name].values.reshape(-1, 3, 3) for name in ("led_orientation", "R_e"))
    turned = [turns_between(np.broadcast_to(R[:1], R.shape), R) for R in (tool, commanded)]
    _plot_axes(turn, log.time, *turned)
    turn.set(title="Rotation of tool and leader (dashed)", ylabel="rotation in rad")
    angle = np.linalg.norm(turns_between(tool, commanded), axis=1)
    apart.plot(log.time, 1e3 * angle, color="C0")
    apart.set(title="Angle between leader and tool", ylabel="angle in mrad")
    _plot_sizes(moment, log, "moment", "on the tool")
    moment.set(title="Moments", ylabel="moment in Nm")
    style.add_legend(turn)
    style.add_legend(moment)
    caption = "Rotation vectors since the start, world axes."
    return style.Drawing("led_turns", "Teleoperated orientation", caption, canvas)


def _plot_axes(panel: "Axes", time: np.ndarray, tool: np.ndarray, commanded: np.ndarray) -> None:
    """Plot actual (solid) and commanded (dashed) motion of the tool along each axis."""
    for k, axis in enumerate(_AXES):
        panel.plot(time, tool[:, k], color=f"C{k}", label=axis)
        panel.plot(time, commanded[:, k], "--", color=f"C{k}", linewidth=0.9)


def _plot_sizes(panel: "Axes", log: RunLog, kind: str, label: str) -> None:
    """Plot magnitudes of forces or moments at both sides."""
    felt = log.norm(f"leader_{kind}")
    at_tool = np.linalg.norm(log[f"port_{kind}"].values[:, 3:], axis=1)
    panel.plot(log.time, felt, color="C1", label="on the operator")
    panel.plot(log.time, at_tool, color=style.INK, linewidth=0.9, label=label)


def draw_port_energy(log: RunLog) -> style.Drawing:
    """Draw the work of both ports, and the energy in channel and tanks."""
    canvas, (work, stored, share) = style.make_panels(3)
    done = -works(log)
    work.plot(log.time, done[:, 0], color="C0", label="from the operator")
    work.plot(log.time, -done[:, 1], color="C1", label="to the follower")
    bound = float(log["port_tank"].values[0].sum())
    total = done.sum(axis=1)
    work.plot(log.time, total, color=style.INK, label="difference")
    work.axhline(-bound, color=style.INK, linestyle="--", linewidth=0.9, label="lower bound")
    work.set(title="Work of the coupling's forces", ylabel="work in J")
    tank, in_transit = log["port_tank"].values, stored_in_channel(log)
    for k, name in enumerate(("leader", "follower")):
        stored.plot(log.time, tank[:, k], color=f"C{k}", label=f"tank of the {name}")
        stored.plot(
            log.time,
            in_transit[:, k],
            ":",
            color=f"C{k}",
            label=f"in transit from the {name}",
        )
    stored.set(title="Stored energy", ylabel="energy in J")
    for k, name in enumerate(("leader", "follower")):
        share.plot(log.time, log["port_share"].values[:, k], color=f"C{k}", label=name)
    share.set(title="Share of force and wave covered by the tank", ylabel="share", ylim=(0, 1.05))
    for panel in (work, stored, share):
        style.add_legend(panel)
    caption = (
        "Energy from the operator minus energy to the follower is stored in tanks and channel or "
        "dissipated; it is bounded below by minus the initial energy of the tanks."
    )
    return style.Drawing("port_energy", "Energy of the teleoperation", caption, canvas)


def _requirements(settings: Scenario) -> dict[str, Target]:
    """Require passivity, and final agreement of leader and follower."""
    coupling = settings.teleoperation
    if coupling is None:
        return {}
    tanks = dict.fromkeys(
        _ALWAYS if coupling.passive else (), Target(">= 0", "teleoperation.passive")
    )
    return tanks | {"owed_distance_end": Target(f"<= {_OWED:g}", "leader and follower meet")}


FEATURE = Feature(
    signals=add_teleoperation,
    metrics=lambda log, station, settings: teleoperation_metrics(log, settings),
    requirements=_requirements,
    always=_ALWAYS,
    # a leader may be another process
    known=lambda station, settings: () if settings.teleoperation is None else ("led_point",),
    warnings=lambda log, station, settings: handle_warnings(log, settings),
    figures={
        "teleoperation": draw_teleoperation,
        "led_turns": draw_leader_turns,
        "port_energy": draw_port_energy,
    },
)
