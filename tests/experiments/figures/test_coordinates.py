"""Figures of the path's coordinates, drawn from made-up logs."""

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from experiments.figures.coordinates import (
    draw_angles,
    draw_axis,
    draw_orientation,
    draw_progress,
    draw_transversal,
)
from pfsc_drake.control.manifolds.orientation import ToolOrientation


def lines(panel):
    """Data of a panel by label; the zero line and other nameless ones are left out."""
    named = [line for line in panel.lines if not line.get_label().startswith("_")]
    return {line.get_label(): np.asarray(line.get_ydata()) for line in named}


def titles(drawing):
    return [panel.get_title() for panel in drawing.canvas.axes]


@pytest.fixture
def compliant_log(drawn_log):
    """References that yield: xi by 20 mm and 0, phi about z by 30 mrad, eta by 5 mm."""
    yielding = np.sin(np.pi * drawn_log.time) ** 2
    drawn_log["xi_p"].values = np.outer(yielding, [0.02, 0.0])
    drawn_log["xi"].values = drawn_log["xi_p"].values + np.array([2e-4, -1e-4])
    drawn_log.add("phi_p", np.outer(yielding, [0.03, 0.0, 0.0]), "rad")
    drawn_log["phi"].values = drawn_log["phi_p"].values + np.array([0.0, 0.0, 1e-3])
    drawn_log.add("eta_d", drawn_log["eta_p"].values - 5e-3 * yielding[:, None], "m")
    drawn_log.add("xi_d", np.zeros((201, 2)), "m")
    return drawn_log


def test_progress_shows_the_error(drawn_log):
    drawing = draw_progress(drawn_log)
    position, error, speed = drawing.canvas.axes
    np.testing.assert_allclose(lines(position)[r"$\eta$"], 0.3 * drawn_log.time)
    np.testing.assert_allclose(error.lines[0].get_ydata(), -1.0, atol=1e-9)
    assert error.get_ylabel() == "error in mm"
    np.testing.assert_allclose(speed.lines[0].get_ydata(), 0.3)
    assert "yields" not in drawing.caption


def test_small_errors_are_in_micrometres(drawn_log):
    drawn_log["eta_p"].values = drawn_log["eta"].values - 2e-6
    error = draw_progress(drawn_log).canvas.axes[1]
    np.testing.assert_allclose(error.lines[0].get_ydata(), 2.0, rtol=1e-6)
    assert error.get_ylabel() == "error in µm"


def test_progress_shows_how_far_the_reference_yields(compliant_log):
    drawing = draw_progress(compliant_log)
    position, _, yielding, _ = drawing.canvas.axes
    assert r"$\eta^d$ (desired)" in lines(position)
    expected = 5.0 * np.sin(np.pi * compliant_log.time) ** 2
    np.testing.assert_allclose(yielding.lines[0].get_ydata(), expected, atol=1e-9)
    assert "mm" in yielding.get_ylabel()
    assert "yields" in drawing.caption
    compliant_log["eta_d"].values = compliant_log["eta_p"].values.copy()
    assert len(draw_progress(compliant_log).canvas.axes) == 3


def test_transversal_is_enlarged_after_convergence(drawn_log):
    drawing = draw_transversal(drawn_log)
    panels = drawing.canvas.axes
    low, high = panels[1].get_ylim()
    late = 10.0 * np.exp(-9 * 0.25)  # mm, where the last three quarters begin
    assert (low, high) == pytest.approx((-1.2 * late, 1.2 * late))
    assert titles(drawing)[1] == "The same, scaled to the last three quarters"
    assert panels[2].get_yscale() == "log"
    assert "reference" not in drawing.caption


def test_transversal_is_not_repeated_without_need(drawn_log):
    drawn_log["xi"].values[:] = [1e-3, 0.0]
    panels = draw_transversal(drawn_log).canvas.axes
    assert len(panels) == 2
    np.testing.assert_allclose(panels[1].lines[0].get_ydata(), 1.0)


def test_transversal_over_a_reference_that_yields(compliant_log):
    drawing = draw_transversal(compliant_log)
    position, error, distance = drawing.canvas.axes
    expected = 20.0 * np.sin(np.pi * compliant_log.time) ** 2
    reference = max(position.lines, key=lambda line: line.get_linewidth())
    np.testing.assert_allclose(reference.get_ydata(), expected, atol=1e-12)
    assert r"$\xi^p$ (reference)" in lines(position)
    assert not any("desired" in label for label in lines(position))  # zero throughout
    np.testing.assert_allclose(lines(error)[r"$\xi_1$"], 0.2, rtol=1e-9)
    np.testing.assert_allclose(lines(error)[r"$\xi_2$"], -0.1, rtol=1e-9)
    assert error.get_ylabel() == "deviation in mm"
    assert r"\xi - \xi^p" in titles(drawing)[1]
    sizes = lines(distance)
    np.testing.assert_allclose(sizes[r"from the reference $\|\xi - \xi^p\|$"], np.hypot(0.2, 0.1))
    assert sizes[r"$\|\xi\|$"].max() == pytest.approx(20.2, abs=0.01)


def test_transversal_with_a_desired_offset_and_motors(compliant_log):
    compliant_log["xi_d"].values[:, 1] = 3e-3
    compliant_log.add("xi_M", np.full((201, 2), 3e-3), "m")
    compliant_log.add("xi_measured", np.tile([3e-3, 4e-3], (201, 1)), "m")
    position, _, distance = draw_transversal(compliant_log).canvas.axes
    assert r"$\xi^d$ (desired)" in lines(position)
    dashed = {line.get_label(): line.get_ydata() for line in position.lines}
    np.testing.assert_allclose(dashed[r"_$\xi_2$"], 3.0)
    np.testing.assert_allclose(
        lines(distance)[r"of the motors $\|\xi_M\|$"], 3.0 * np.sqrt(2.0), rtol=1e-12
    )
    np.testing.assert_allclose(lines(distance)["as measured"], 5.0)


def test_references_of_rounding_errors_are_none(compliant_log):
    compliant_log["xi_p"].values[:] = 4e-16
    compliant_log["xi_d"].values[:] = -2e-16
    position, *_, distance = draw_transversal(compliant_log).canvas.axes
    assert set(lines(position)) == {r"$\xi_1$", r"$\xi_2$"}
    assert set(lines(distance)) == {r"$\|\xi\|$"}


def test_orientation_over_a_reference_that_yields(drawn_log, compliant_log):
    angles, error, size = draw_orientation(compliant_log).canvas.axes
    assert r"$\phi^p$ (reference)" in lines(angles)
    np.testing.assert_allclose(lines(error)[r"$\psi$ (about x)"], 1.0, rtol=1e-9)
    assert error.get_ylabel() == "deviation in mrad"
    assert len(lines(size)) == 2
    del drawn_log.signals["phi_p"]
    drawing = draw_orientation(drawn_log)
    assert len(drawing.canvas.axes) == 2
    assert drawing.title == "Orientation error"


def test_angles_in_degrees(drawn_log):
    drawing = draw_angles(drawn_log)
    assert titles(drawing) == ["Rotation about z", "Rotation about y", "Rotation about x"]
    for panel, tool, path, axis in zip(
        drawing.canvas.axes, (0.1, 0.2, 0.3), (0.1, 0.2, 0.2), "zyx", strict=True
    ):
        assert panel.get_ylabel() == "angle in deg"
        drawn = lines(panel)
        np.testing.assert_allclose(drawn[f"tool, about {axis}"], np.rad2deg(tool) * drawn_log.time)
        np.testing.assert_allclose(drawn[r"reference $R_d$"], np.rad2deg(path) * drawn_log.time)
    assert "waits" in drawing.caption
    drawn_log.add("tracking_error", np.zeros((201, 3)), "m")
    assert "runs on" in draw_angles(drawn_log).caption


def test_angles_a_turn_apart_are_the_same(drawn_log):
    """A tool that points down, once at 180 deg and once at -180 deg; unknown at the end."""
    down = np.tile([0.0, 0.0, np.pi], (201, 1))
    drawn_log["angles_d"].values, drawn_log["angles_e"].values = down, -down + 1e-3
    drawn_log["angles_e"].values[-1] = np.nan
    drawn = lines(draw_angles(drawn_log).canvas.axes[2])
    expected = 180.0 + np.rad2deg(1e-3)
    np.testing.assert_allclose(drawn["tool, about x"][:-1], expected)
    drawn_log["angles_e"].values[:] = np.nan
    assert np.isnan(lines(draw_angles(drawn_log).canvas.axes[2])["tool, about x"]).all()


def test_constant_angles_are_not_blown_up(drawn_log):
    drawn_log["angles_e"].values = np.tile([1.0, 2.0, 3.0], (201, 1)) + 1e-9
    drawn_log["angles_d"].values = np.tile([1.0, 2.0, 3.0], (201, 1))
    low, high = draw_angles(drawn_log).canvas.axes[0].get_ylim()
    assert high - low == pytest.approx(2.0)
    assert 0.5 * (low + high) == pytest.approx(np.rad2deg(1.0), abs=1e-3)


def test_zyz_angles_are_called_so(drawn_log):
    """With names that can be written as symbols, too."""
    names = [coordinate.name for coordinate in ToolOrientation(euler="zyz").coordinates]
    drawn_log["phi"].labels = names
    drawn_log["angles_e"].labels = [name.removeprefix("phi_") for name in names]
    drawing = draw_orientation(drawn_log)
    assert "ZYZ angles of the tool against" in drawing.caption
    assert r"$\psi$ (about z again)" in lines(drawing.canvas.axes[0])
    assert "ZYZ angles of tool and path" in draw_angles(drawn_log).caption
    for name in names:
        MathTextParser("path").parse(rf"$v_{{\{name}}}$")


def test_orientation_of_an_axis(drawn_log):
    drawn_log["phi"].values = drawn_log["phi"].values[:, :2]
    drawn_log["phi"].labels = ["phi_z", "phi_y"]
    drawn_log.signals.pop("phi_p", None)
    drawing = draw_orientation(drawn_log)
    assert titles(drawing)[0] == "Error of the tool's axis"
    assert "the turn about the axis is free" in drawing.caption
    angles, _ = drawing.canvas.axes
    assert set(lines(angles)) == {r"$\varphi$", r"$\vartheta$"}


def test_direction_of_an_axis(drawn_log):
    angle = 1e-3 * (1.0 + drawn_log.time)
    tool = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    drawn_log.add("axis_e", tool, "1", ["x", "y", "z"])
    drawn_log.add("axis_d", np.tile([0.0, 0.0, 1.0], (201, 1)), "1", ["x", "y", "z"])
    drawing = draw_axis(drawn_log)
    direction, between = drawing.canvas.axes
    np.testing.assert_array_equal(lines(direction)["x"], tool[:, 0])
    (drawn,) = between.get_lines()
    np.testing.assert_allclose(drawn.get_ydata(), 1e3 * angle, rtol=1e-9)
    assert between.get_ylabel() == "angle in mrad"
    assert "waits" in drawing.caption
    drawn_log.add("tracking_error", np.zeros((201, 3)), "m")
    assert "runs on" in draw_axis(drawn_log).caption
