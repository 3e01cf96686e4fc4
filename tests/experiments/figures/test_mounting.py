"""A plate that is mounted, drawn from a made-up log."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.forces import draw_damping, has_varying_damping
from experiments.figures.mounting import draw_mounting, draw_use_case
from experiments.results.run_log import RunLog

TIME = np.linspace(0.0, 10.0, 501)
PHASES = ["grip", "lead", "align", "insert", "release", "leave", "done"]


@pytest.fixture(name="log")
def fixture_log():
    gap = np.interp(TIME, [0.0, 4.0, 5.0, 6.0], [0.5, 0.02, 0.012, 0.0])
    log, unit = RunLog(TIME), np.ones(6)
    log.add("seat_gap", np.column_stack([gap, gap]), "m")
    log.add("seat_offset", 1e-4 * np.ones_like(TIME), "m")
    for name in ("frame_force", "magazine_force"):
        log.add(name, np.outer(TIME > 5.0, [0.0, 3.0, 4.0]), "N")
    log.add("gripper_wrench", np.outer(TIME, unit), "N, Nm")
    log.add("held", TIME < 7.0, "1")
    log.add("hand_wrench", np.outer(np.sin(TIME), unit), "N, Nm")
    log.add("phase", np.minimum(TIME / 1.5, 6.0).astype(int), "1", PHASES)
    for name in ("eta", "eta_p"):
        log.add(name, 0.1 * TIME, "m")
    for name, size in (("xi", 2), ("phi", 3)):
        log.add(name, np.outer(TIME, 1e-3 * np.ones(size)), "m" if size == 2 else "rad")
        log.add(f"{name}_p", np.outer(TIME, 2e-3 * np.ones(size)), "m")
    log.add("manifold_force", np.outer(TIME, np.arange(1.0, 7.0)), "N, Nm")
    log.add("damping", np.outer(3000.0 - 100.0 * TIME, unit), "N s/m")
    log.add("tau_d", np.outer(TIME, np.arange(1.0, 7.0)), "Nm")
    return log


def lines(panel):
    """Return what is drawn over the time of the log, by label."""
    return {
        line.get_label(): np.asarray(line.get_ydata())
        for line in panel.lines
        if np.size(line.get_ydata()) == TIME.size
    }


def test_the_use_case_has_the_panels_of_the_dissertation(log):
    panels = draw_use_case(log).canvas.axes
    assert [panel.get_title("left")[:3] for panel in panels] == [f"({x})" for x in "abcdefgh"]
    np.testing.assert_allclose(lines(panels[1])[r"$\xi_1$"], TIME)  # mm
    np.testing.assert_allclose(next(iter(lines(panels[3]).values())), 3.0 - 0.1 * TIME)  # kNs/m
    np.testing.assert_allclose(lines(panels[4])[r"$\phi_z$"], TIME)  # mrad
    np.testing.assert_allclose(lines(panels[5])[r"$\tau_x$"], 6.0 * TIME)
    np.testing.assert_allclose(lines(panels[7])[r"$\tau_{d,6}$"], 6.0 * TIME)


def test_the_plate_at_the_frame(log):
    near, contact, hand = draw_mounting(log).canvas.axes
    assert near.get_ylim()[1] < 30.0  # mm, not the way from the magazine
    np.testing.assert_allclose(lines(contact)["frame"], 5.0 * (TIME > 5.0))
    np.testing.assert_allclose(lines(hand)["force in N"], np.sqrt(3.0) * np.abs(np.sin(TIME)))
    shaded = {text.get_text() for text in near.get_legend().get_texts()}
    assert shaded >= {"grip", "lead", "align", "insert", "release", "leave"}


def test_both_are_in_the_report(log):
    assert {d.name for d in draw_figures(log, [])} >= {"use_case", "mounting"}


def test_the_damping_is_drawn_over_the_arc_length(log):
    assert has_varying_damping(log)
    (line,) = draw_damping(log).canvas.axes[0].lines
    np.testing.assert_allclose(line.get_xdata(), 0.1 * TIME)
    np.testing.assert_allclose(line.get_ydata(), 3.0 - 0.1 * TIME)  # kNs/m
    log.signals["damping"].values[:] = 90.0
    assert not has_varying_damping(log)


def test_without_operator_and_compliance_one_is_left(log):
    for name in ("hand_wrench", "phase", "damping", "manifold_force"):
        del log.signals[name]
    names = [drawing.name for drawing in draw_figures(log, [])]
    assert "mounting" in names
    assert "use_case" not in names
