"""Figures of the orientation, drawn from made-up logs."""

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from experiments.results.orientation_feature import draw_angles, draw_axis, draw_orientation
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
    assert "is a function of time" in draw_angles(drawn_log).caption


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
    assert "ZYZ angles of the tool relative to" in drawing.caption
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
    assert "the rotation about the axis is free" in drawing.caption
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
    assert "is a function of time" in draw_axis(drawn_log).caption
