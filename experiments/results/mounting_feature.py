"""Mounting of plates: signals, metrics and figures.

Signals used, as in the log: ``seat_gap`` [samples, pins] m between a plate and the frame at its
pins, ``seat_offset`` [samples, 1] m, its lateral distance from the seat, ``frame_force`` and
``magazine_force`` [samples, 3] N on the plates, ``held`` [samples, 1], share of the gripper's
attached cups, ``hand_wrench`` [samples, 6] N and Nm of the operator, ``xi`` [samples, 2] m and
``phi`` [samples, 3] rad, deviation of the tool from the path; from the first touch of the frame
until the plate is seated their means are ``insertion_deviation`` and ``insertion_rotation``.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagrams.environment.mounting import Mounting
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.physics.mounting_hand import MountingPhase
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SEATED = 2e-4  # m, largest gap at every pin of a seated plate
BESIDE = 2e-3  # m, largest lateral distance from the seat
REACHED = 0.02  # m, gap and lateral distance of a plate at the frame
TOUCHING = 0.5  # N, least force of a contact
# panels as in Fig. 5.13: title, signal, its factor, unit, columns, names
_PANELS: list[tuple[str, str, float, str, slice, list[str]]] = [
    ("Along the path", "eta", 1.0, "m", slice(None), [r"$\eta$"]),
    ("Deviation from the path", "xi", 1e3, "mm", slice(None), [r"$\xi_1$", r"$\xi_2$"]),
    (
        *("Measured forces", "manifold_force", 1.0, "N", slice(0, 3)),
        [r"$\tau_\parallel$", r"$\tau_\perp$", r"$\tau_\times$"],
    ),
    (r"Damping $d_\parallel$", "damping", 1e-3, "kNs/m", slice(0, 1), [""]),
    (
        *("Orientation error", "phi", 1e3, "mrad", slice(None)),
        [rf"$\phi_{axis}$" for axis in "zyx"],
    ),
    (
        *("Measured moments", "manifold_force", 1.0, "Nm", slice(3, 6)),
        [rf"$\tau_{axis}$" for axis in "zyx"],
    ),
    *(
        (
            *(f"Drive torques, axes {first + 1} to {first + 3}", "tau_d", 1.0, "Nm"),
            slice(first, first + 3),
            [rf"$\tau_{{d,{first + i}}}$" for i in (1, 2, 3)],
        )
        for first in (0, 3)
    ),
]
_HEIGHT = 10.0  # inches, of the four rows of the use case
_PHASE_COLOURS = ("#DBEAFE", "#F3F4F6", "#FEF3C7", "#DCFCE7", "#FCE7F3", "#E5E7EB", "#FFFFFF")


def seated_samples(log: RunLog) -> NDArray[np.bool_]:
    """Return the samples at which the plate is seated, shape (samples,)."""
    flush = np.all(np.abs(log["seat_gap"].values) <= SEATED, axis=1)
    return np.asarray(flush & (log["seat_offset"].values[:, 0] <= BESIDE))


def time_to_frame(log: RunLog) -> float:
    """Return the first time at which the plate is 2 cm from its seat [s]; NaN if it never is."""
    near = np.all(np.abs(log["seat_gap"].values) <= REACHED, axis=1)
    return _first(log.time, near & (log["seat_offset"].values[:, 0] <= REACHED))


def time_to_contact(log: RunLog) -> float:
    """Return the first time at which a plate touches the frame [s]; NaN if none does."""
    return _first(log.time, log.norm("frame_force") > TOUCHING)


def time_to_seat(log: RunLog) -> float:
    """Return the first time at which the plate is seated [s]; NaN if it never is."""
    return _first(log.time, seated_samples(log))


def grip_time(log: RunLog) -> float:
    """Return the last time at which all cups attached to a plate [s].

    It is the start for a plate that is grasped initially, NaN without a grasped plate.
    """
    grasped = log["held"].values[:, 0] >= 1.0
    taken = np.flatnonzero(grasped & ~np.append(False, grasped[:-1]))
    return float(log.time[taken[-1]]) if taken.size else math.nan


def release_time(log: RunLog) -> float:
    """Return the first time at which all cups released a grasped plate [s]; NaN without."""
    grasped = log["held"].values[:, 0] > 0.0
    return _first(log.time, ~grasped & np.append(False, grasped[:-1]))


def mounting_metrics(log: RunLog) -> Metrics:
    """Return the metrics of mounting, none without ``seat_gap``."""
    metrics = Metrics()
    if "seat_gap" not in log or log.time.size == 0:
        return metrics
    seated, at = seated_samples(log), time_to_seat(log)
    let_go = math.isfinite(release_time(log))
    metrics.add("mounted", float(seated[-1] and let_go))
    metrics.add("final_seat_gap", float(np.abs(log["seat_gap"].values[-1]).max()))
    metrics.add("grip_time", grip_time(log))
    metrics.add("time_to_frame", time_to_frame(log))
    metrics.add("time_to_contact", time_to_contact(log))
    metrics.add("time_to_seat", at)
    metrics.add("insertion_time", at - time_to_frame(log))
    metrics.add("release_time", release_time(log))
    metrics.add("peak_frame_force", float(log.norm("frame_force").max()))
    metrics.add("peak_magazine_force", float(log.norm("magazine_force").max()))
    inserting = (log.time >= time_to_contact(log)) & (log.time <= at)
    for name, signal in (("insertion_deviation", "xi"), ("insertion_rotation", "phi")):
        sizes = log.norm(signal)[inserting]
        metrics.add(name, float(np.mean(sizes)) if sizes.size else math.nan)
    if "hand_wrench" in log:
        force, torque = np.hsplit(log["hand_wrench"].values, 2)
        metrics.add("peak_operator_force", float(np.linalg.norm(force, axis=1).max()))
        metrics.add("peak_operator_torque", float(np.linalg.norm(torque, axis=1).max()))
    return metrics


def _first(time: FloatArray, where: NDArray[np.bool_]) -> float:
    found = np.flatnonzero(where)
    return float(time[found[0]]) if found.size else math.nan


def add_mounting_signals(log: RunLog, station: Station, raw: Raw) -> None:
    """Add poses and contact forces of plates, and phase and forces of the operator.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    if station.mounting is None:
        return
    poses = plate_poses(raw["plate_state"])
    names = [*"xyz", *(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]
    labels = [f"plate_{k + 1}_{name}" for k in range(poses.shape[1] // 12) for name in names]
    log.add("plate_pose", poses, labels=labels)
    gap, offset = seat_distances(station.mounting, poses[:, :12])
    log.add("seat_gap", gap)
    log.add("seat_offset", offset)
    frame, magazine = np.hsplit(raw["plate_contact"], 2)
    log.add("frame_force", frame)
    log.add("magazine_force", magazine)
    log.add("held", raw["held"])
    log.add("gripper_wrench", raw["gripper_wrench"])
    if "hand_wrench" in raw:
        log.add("hand_wrench", raw["hand_wrench"])
        phases = [phase.name.lower() for phase in MountingPhase]
        log.add("phase", raw["phase"].astype(int), labels=phases)


def plate_poses(state: FloatArray) -> FloatArray:
    """Return ``[p, R by rows]`` of K plates, world axes, shape (samples, 12 K).

    Args:
        state: State of their plant, see :func:`~pfsc_drake.physics.suction.cups_function`, shape
            (samples, 13 K).
    """
    samples, count = len(state), state.shape[1] // 13
    q = state[:, : 7 * count].reshape(samples, count, 7)
    R = quaternion_to_matrix(q[..., :4]).reshape(samples, count, 9)
    return np.concatenate([q[..., 4:], R], axis=2).reshape(samples, 12 * count)


def seat_distances(mounting: Mounting, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distances of a plate from its seat.

    Args:
        mounting: Parameters of the seat.
        pose: ``[p, R by rows]`` of the plate, shape (samples, 12).

    Returns:
        Gap between underside and frame at each pin, negative below its surface, shape (samples,
        pins), and lateral distance from the seat, shape (samples, 1) [m].
    """
    pins, seat = np.array(mounting.parameters.pins.positions), mounting.X_WF
    roots = np.column_stack([pins, np.zeros(len(pins))])
    R = pose[:, 3:].reshape(-1, 3, 3)
    points = pose[:, np.newaxis, :3] + np.einsum("tij,nj->tni", R, roots)
    # the gripped face is as far from its seat as the underside
    in_frame = (points - seat.translation()) @ seat.rotation().matrix()
    beside = np.linalg.norm(in_frame[:, :, :2] - pins, axis=2).max(axis=1, keepdims=True)
    return -in_frame[:, :, 2], beside


def draw_use_case(log: RunLog) -> style.Drawing:
    """Draw eight panels over time: coordinates, forces, damping and drive torques."""
    canvas = style.make_canvas(style.WIDTH, _HEIGHT)
    panels = canvas.subplots(4, 2, sharex=True).ravel()
    for letter, panel, row in zip("abcdefgh", panels, _PANELS, strict=True):
        title, name, factor, unit, part, labels = row
        if name in log:
            if f"{name}_p" in log:
                label = rf"$\{name}^p$"
                style.draw_reference(panel, log.time, factor * log[f"{name}_p"].values, label)
            style.draw_components(panel, log.time, factor * log[name].values[:, part], labels)
            panel.set(ylabel=unit, title=title)
        panel.set_title(f"({letter}) {panel.get_title('left') or panel.get_title()}", loc="left")
        if panel.get_legend_handles_labels()[1]:
            panel.legend(loc="best", ncols=2, fontsize="x-small")
        for when in (time_to_frame(log), time_to_seat(log)):
            if np.isfinite(when):
                panel.axvline(when, color=style.REFERENCE, linewidth=0.8, linestyle=":")
    for panel in panels[-2:]:
        panel.set_xlabel("time in s")
    canvas.tight_layout()
    caption = (
        "Tangential and transversal coordinates over their references (broad), generalized forces "
        "of operator and contact, damping along the path, orientation over its reference, "
        "generalized moments, and drive torques; dotted: first contact with the frame, plate "
        "seated."
    )
    return style.Drawing("use_case", "Plate mounting", caption, canvas)


def draw_mounting(log: RunLog) -> style.Drawing:
    """Draw gap between plate and frame, forces of contacts and operator, and attached cups."""
    canvas, (near, contact, hand) = style.make_panels(3, height=2.4)
    gap = 1e3 * log["seat_gap"].values
    style.draw_components(near, log.time, gap, [f"pin {i + 1}" for i in range(gap.shape[1])])
    near.set(ylabel="gap in mm", title="Gap between plate and frame at the pins")
    _show_insertion(near, log, gap)
    for column, (name, label) in enumerate(
        (("frame_force", "frame"), ("magazine_force", "magazine"), ("gripper_wrench", "gripper"))
    ):
        size = np.linalg.norm(log[name].values[:, :3], axis=1)
        contact.plot(log.time, size, color=f"C{column}", label=label)
    contact.set(ylabel="force in N", title="Forces on plates")
    if "hand_wrench" in log:
        force, torque = np.hsplit(log["hand_wrench"].values, 2)
        hand.plot(log.time, np.linalg.norm(force, axis=1), color="C0", label="force in N")
        hand.plot(
            log.time, 10.0 * np.linalg.norm(torque, axis=1), color="C1",
            label="moment in 0.1 Nm"
        )  # fmt: skip
        _shade_phases([near, contact, hand], log)
    attached = 10.0 * log["held"].values
    hand.plot(log.time, attached, color="C2", label="share of attached cups, times 10")
    hand.set(title="Operator" if "hand_wrench" in log else "Gripper")
    for panel, columns in ((near, 5), (contact, None), (hand, None)):
        style.add_legend(panel, columns)
    caption = (
        "Gap between the plate's underside and the frame at each pin during insertion, forces of "
        "frame, magazine and gripper on the plates, and forces of the operator; shaded: phases of "
        "the operator."
    )
    return style.Drawing("mounting", "Plate at the frame", caption, canvas)


def _show_insertion(panel: "Axes", log: RunLog, gap: np.ndarray) -> None:
    """Scale the gap to the time of the insertion."""
    touched = time_to_frame(log)
    if np.isfinite(touched):
        near = gap[np.searchsorted(log.time, touched)]
        top = max(2.0, 1.3 * float(near.max()))
        panel.set_ylim(-0.15 * top, top)


def _shade_phases(panels: "list[Axes]", log: RunLog) -> None:
    phase = log["phase"].values[:, 0]
    for k, (name, colour) in enumerate(zip(log["phase"].labels, _PHASE_COLOURS, strict=True)):
        if np.any(phase == k) and colour != "#FFFFFF":
            style.shade(panels, log.time, phase == k, name, colour)


FEATURE = Feature(
    signals=add_mounting_signals,
    metrics=lambda log, station, settings: mounting_metrics(log),
    figures={"use_case": draw_use_case, "mounting": draw_mounting},
)
