"""Warnings about links outside of the capsules of an arm."""

import math
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

from diagrams.drawing.robot_geometry import draw_robot
from diagrams.robots.arm import add_arm
from diagrams.station_options import StationOptions
from diagrams.warnings.uncovered_links import uncovered_links
from pfsc_drake.control.obstacles.obstacle_watch import ArmAhead
from pfsc_drake.robot.serial.outline import arm_outline

INERTIAL = (
    "<inertial><mass value='1'/><inertia ixx='.01' iyy='.01' izz='.01' ixy='0' ixz='0' iyz='0'/>"
    "</inertial>"
)


def _link(name, form, origin="xyz='0 0 0'"):
    seen = f"<visual><origin {origin}/><geometry>{form}</geometry></visual>" if form else ""
    return f"<link name='{name}'>{INERTIAL}{seen}</link>"


def _joint(number, parent, child, x):
    return (
        f"<joint name='joint_{number}' type='revolute'><parent link='{parent}'/>"
        f"<child link='{child}'/><origin xyz='{x} 0 0'/><axis xyz='0 0 1'/>"
        "<limit lower='-2' upper='2' velocity='3' effort='50'/></joint>"
    )


HAND = _link("hand", "<cylinder radius='.08' length='.3'/>", "xyz='.2 0 0' rpy='0 1.57079632679 0'")
# along x, joints and tip 0.4 m apart
ARM = "".join(
    [
        "<robot name='boxed'>",
        _link("base", "<box size='2 2 2'/>"),
        _link("upper", "<box size='1 1 1'/>"),
        _link("fore", "<box size='.2 .1 .1'/>", "xyz='.2 .15 0'"),
        HAND,
        _link("tip", "<sphere radius='.12'/>"),
        _joint(1, "base", "upper", 0.0),
        _joint(2, "upper", "fore", 0.4),
        _joint(3, "fore", "hand", 0.4),
        "<joint name='weld' type='fixed'><parent link='hand'/><child link='tip'/>",
        "<origin xyz='.4 0 0'/></joint></robot>",
    ]
)


@pytest.fixture(name="look_at")
def fixture_look_at(tmp_path, load_scenario):
    """Return ``model -> radius -> sentences``."""
    return lambda model: _looking(model, tmp_path, load_scenario)


@pytest.fixture(name="look")
def fixture_look(look_at):
    return look_at(ARM)


def _looking(model, tmp_path, load_scenario):
    file = tmp_path / "boxed.urdf"
    file.write_text(model, encoding="utf-8")
    settings = load_scenario("pfc_panda_7r")
    settings.robot = type(settings.robot)(str(file), tool_frame="tip")
    settings.model_error = type(settings.model_error)()
    part = add_arm(DiagramBuilder(), StationOptions(settings, Path()).nominal_model_source)
    drawn = draw_robot(part.model, part.tool, settings.robot, Path()).parts

    def look(radius):
        outline = arm_outline(part.robot, radius)
        ahead = ArmAhead(part.robot, outline, 0.0, 0.1, np.zeros((1, 3)))
        return uncovered_links(part, drawn, ahead)

    return look


def test_who_reaches_out_is_named_with_how_far(look):
    """What is before the second joint is not looked at, however large it is."""
    (warning,) = look(0.1)
    assert "arm_radius = 0.1 m" in warning
    assert f"fore {math.hypot(0.2, 0.05):.3g} m, tip 0.12 m" in warning
    for name in ("base", "upper", "hand"):
        assert name not in warning
    assert "hand 0.08 m" in look(0.05)[0]


def test_both_caps_of_a_capsule_count(look_at):
    """Across the arm it reaches half its length and its radius from the axis."""
    capsule = "<capsule radius='.08' length='.3'/>"
    lies = _link("hand", capsule, "xyz='.2 0 0' rpy='1.57079632679 0 0'")
    look = look_at(ARM.replace(HAND, lies))
    assert "hand 0.23 m" in look(0.15)[0]
    assert look(0.231) == []


def test_nothing_is_said_where_all_are_inside(look):
    assert look(0.207) == []
