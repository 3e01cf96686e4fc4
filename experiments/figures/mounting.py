"""A plate that is mounted: the use case as a whole, and the plate at the frame."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.results.mounting import time_to_frame, time_to_seat
from experiments.results.run_log import RunLog
from reporting.style import (
    COLOURS,
    REFERENCE,
    WIDTH,
    Drawing,
    draw_components,
    draw_reference,
    make_panels,
    place_legend,
    shade,
)

_HEIGHT = 10.0  # inches, of the four rows of the use case
_PHASE_COLOURS = ("#DBEAFE", "#F3F4F6", "#FEF3C7", "#DCFCE7", "#FCE7F3", "#E5E7EB", "#FFFFFF")


def draw_use_case(log: RunLog) -> Drawing:
    """Eight panels over time: coordinates, forces, damping and drive torques."""
    canvas = Canvas(figsize=(WIDTH, _HEIGHT))
    panels = canvas.subplots(4, 2, sharex=True).ravel()
    for letter, panel, (draw, needed) in zip("abcdefgh", panels, _PANELS, strict=True):
        if needed in log:
            draw(panel, log)
        panel.set_title(f"({letter}) {panel.get_title('left') or panel.get_title()}", loc="left")
        if panel.get_legend_handles_labels()[1]:
            panel.legend(loc="best", ncols=2, fontsize="x-small")
        for when in (time_to_frame(log), time_to_seat(log)):
            if np.isfinite(when):
                panel.axvline(when, color=REFERENCE, linewidth=0.8, linestyle=":")
    for panel in panels[-2:]:
        panel.set_xlabel("time in s")
    canvas.tight_layout()
    caption = (
        "Tangential and transversal coordinates over their references (broad), generalized forces "
        "of operator and contact together, damping along the path, orientation over its "
        "reference, generalized moments, and drive torques; dotted: the frame is touched, the "
        "plate is seated."
    )
    return Drawing("use_case", "Plate mounting", caption, canvas)


def draw_mounting(log: RunLog) -> Drawing:
    """Gap between plate and frame, contact forces and the operator's, and what is held."""
    canvas, (near, contact, hand) = make_panels(3, height=2.4)
    gap = 1e3 * log["seat_gap"].values
    draw_components(near, log.time, gap, [f"pin {i + 1}" for i in range(gap.shape[1])])
    near.set(ylabel="gap in mm", title="Gap between plate and frame at the pins")
    _show_insertion(near, log, gap)
    for column, (name, label) in enumerate(
        (("frame_force", "frame"), ("magazine_force", "magazine"), ("gripper_wrench", "gripper"))
    ):
        size = np.linalg.norm(log[name].values[:, :3], axis=1)
        contact.plot(log.time, size, color=COLOURS[column], label=label)
    contact.set(ylabel="force in N", title="Forces on plates")
    if "hand_wrench" in log:
        force, torque = np.hsplit(log["hand_wrench"].values, 2)
        hand.plot(log.time, np.linalg.norm(force, axis=1), color=COLOURS[0], label="force in N")
        hand.plot(
            log.time, 10.0 * np.linalg.norm(torque, axis=1), color=COLOURS[1],
            label="moment in 0.1 Nm",
        )  # fmt: skip
        _shade_phases([near, contact, hand], log)
    held = 10.0 * log["held"].values
    hand.plot(log.time, held, color=COLOURS[2], label="cups that hold, tenfold")
    hand.set(title="Operator" if "hand_wrench" in log else "Gripper")
    for panel, columns in ((near, 5), (contact, None), (hand, None)):
        place_legend(panel, columns)
    caption = (
        "Gap between the plate's underside and the frame at each pin around the insertion, "
        "what frame, magazine and gripper do to the plates, and the operator; shaded: what the "
        "operator is doing."
    )
    return Drawing("mounting", "Plate at the frame", caption, canvas)


def _show_insertion(panel: Axes, log: RunLog, gap: np.ndarray) -> None:
    """Scale the gap to the time of the insertion."""
    touched = time_to_frame(log)
    if np.isfinite(touched):
        near = gap[np.searchsorted(log.time, touched)]
        top = max(2.0, 1.3 * float(near.max()))
        panel.set_ylim(-0.15 * top, top)


def _shade_phases(panels: list[Axes], log: RunLog) -> None:
    phase = log["phase"].values[:, 0]
    for k, (name, colour) in enumerate(zip(log["phase"].labels, _PHASE_COLOURS, strict=True)):
        if np.any(phase == k) and colour != "#FFFFFF":
            shade(panels, log.time, phase == k, name, colour)


def _draw_eta(panel: Axes, log: RunLog) -> None:
    draw_reference(panel, log.time, log["eta_p"].values, r"$\eta^p$")
    draw_components(panel, log.time, log["eta"].values, [r"$\eta$"])
    panel.set(ylabel="m", title="Along the path")


def _draw_xi(panel: Axes, log: RunLog) -> None:
    draw_reference(panel, log.time, 1e3 * log["xi_p"].values, r"$\xi^p$")
    draw_components(panel, log.time, 1e3 * log["xi"].values, [r"$\xi_1$", r"$\xi_2$"])
    panel.set(ylabel="mm", title="Beside the path")


def _draw_phi(panel: Axes, log: RunLog) -> None:
    draw_reference(panel, log.time, 1e3 * log["phi_p"].values, r"$\phi^p$")
    labels = [rf"$\phi_{axis}$" for axis in "zyx"]
    draw_components(panel, log.time, 1e3 * log["phi"].values, labels)
    panel.set(ylabel="mrad", title="Orientation off the path's")


def _draw_forces(panel: Axes, log: RunLog) -> None:
    labels = [r"$\tau_\parallel$", r"$\tau_\perp$", r"$\tau_\times$"]
    draw_components(panel, log.time, log["manifold_force"].values[:, :3], labels)
    panel.set(ylabel="N", title="Measured forces")


def _draw_moments(panel: Axes, log: RunLog) -> None:
    labels = [rf"$\tau_{axis}$" for axis in "zyx"]
    draw_components(panel, log.time, log["manifold_force"].values[:, 3:], labels)
    panel.set(ylabel="Nm", title="Measured moments")


def _draw_damping(panel: Axes, log: RunLog) -> None:
    panel.plot(log.time, 1e-3 * log["damping"].values[:, 0], color=COLOURS[0])
    panel.set(ylabel="kNs/m", title=r"Damping $d_\parallel$")


def _draw_first_drives(panel: Axes, log: RunLog) -> None:
    _draw_drives(panel, log, slice(0, 3))


def _draw_last_drives(panel: Axes, log: RunLog) -> None:
    _draw_drives(panel, log, slice(3, None))


def _draw_drives(panel: Axes, log: RunLog, part: slice) -> None:
    values = log["tau_d"].values[:, part]
    first = (part.start or 0) + 1
    labels = [rf"$\tau_{{d,{first + i}}}$" for i in range(values.shape[1])]
    draw_components(panel, log.time, values, labels)
    panel.set(ylabel="Nm", title=f"Drive torques, axes {first} to {first + values.shape[1] - 1}")


# as in Fig. 5.13, and which signal each needs beside eta
_PANELS: list[tuple[Callable[[Axes, RunLog], None], str]] = [
    (_draw_eta, "eta_p"),
    (_draw_xi, "xi_p"),
    (_draw_forces, "manifold_force"),
    (_draw_damping, "damping"),
    (_draw_phi, "phi_p"),
    (_draw_moments, "manifold_force"),
    (_draw_first_drives, "tau_d"),
    (_draw_last_drives, "tau_d"),
]
