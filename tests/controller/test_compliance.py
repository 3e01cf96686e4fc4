"""A tool that complies on a user's own path or surface: options of the same call."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import (
    ComplianceParameters,
    ControllerParameters,
    CoordinateImpedance,
    FollowerOptions,
    Profile,
    WaypointTable,
    add_path_following,
    add_surface_following,
    path_from_waypoints,
    rest_to_rest,
    straight_lines,
)
from pfsc_drake.control.compliance.impedance import ImpedanceLaw
from pfsc_drake.control.compliance.impedance_parameters import ImpedanceParameters
from pfsc_drake.control.fixtures.fixture_parameters import RobotLimitParameters
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.controller import compliance as compliance_module
from pfsc_drake.controller.options.controller_parameters import ExternalTorqueParameters
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.robot.models.files import models_directory
from tests.controller.pulled import Pulled

POINTS = [[0.9, -0.3, 0.8], [1.0, 0.0, 0.9], [0.9, 0.3, 0.8], [0.8, 0.0, 0.75]]
SPRING = CoordinateImpedance(Profile(4.0), Profile(200.0), Profile(2500.0))
FREE = CoordinateImpedance(Profile(3.0), Profile(60.0), Profile(0.0))


@pytest.fixture(scope="module", name="path")
def fixture_path():
    return path_from_waypoints(WaypointTable(np.array(POINTS)), smoothness=6, closed=True)


def load(builder):
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(models_directory() / "comau_racer_1_4" / "comau_racer_1_4.sdf"))
    plant.Finalize()
    return plant


def options(**compliance):
    controller = ControllerParameters(external_torque=ExternalTorqueParameters("measured"))
    return FollowerOptions(controller=controller, compliance=ComplianceParameters(**compliance))


def on_path(path, law="rigid", **compliance):
    """Return a tool that stands at the start of a motion along the path."""
    builder = DiagramBuilder()
    plant = load(builder)
    motion = rest_to_rest([0.1, 0.11], velocity=0.1, acceleration=1.0, dwell=5.0)
    chosen = options(**compliance)
    follower = add_path_following(
        builder, plant, "tool_point", path, law, motion=motion, options=chosen
    )
    return Pulled(builder, plant, follower)


def axes(tool):
    point = tool.read("manifold_point")
    return tool.follower.followed.manifold.axes(point).full()


@pytest.mark.slow
def test_a_hand_stays_on_an_open_path():
    """It pushes the tool from 0.1 m against the start, and no farther."""
    table = WaypointTable(np.linspace(POINTS[0], POINTS[1], 9))
    tool = on_path(path_from_waypoints(table, smoothness=6), tangential=FREE)
    assert tool.follower.followed.manifold.coordinates[0].ends[0] == 0.0
    tool.pull(-60.0 * axes(tool)[:, 0])
    tool.run(0.6)
    assert tool.fault() == Fault.NONE
    assert -1e-3 < tool.read("manifold_state")[0] < 5e-3


@pytest.mark.slow
def test_a_tool_yields_across_a_path_like_its_spring(path):
    """By f / k across, and not along."""
    tool = on_path(path, transversal=SPRING)
    across = axes(tool)[:, 1]
    tool.pull(20.0 * across)
    tool.run(0.8)
    assert tool.fault() == Fault.NONE
    eta, *xi = tool.read("manifold_state")[:3]
    force = axes(tool).T @ (20.0 * across)
    np.testing.assert_allclose(tool.read("manifold_force")[1:3], force[1:], atol=1e-9)
    np.testing.assert_allclose(xi, force[1:] / 2500.0, rtol=0.01, atol=2e-5)
    wanted = tool.follower.followed.motion.derivatives(np.array([0.8]), 0)[0, 0, 0]
    assert eta == pytest.approx(wanted, abs=1e-5)
    tool.pull(np.zeros(3))
    tool.run(1.6)
    assert np.linalg.norm(tool.read("manifold_state")[1:3]) < 1e-4


@pytest.mark.slow
def test_a_hand_leads_a_tool_along_a_path_as_far_as_its_joints_are_fast(path):
    """Along with f / d, on the path; then no joint is faster than its share."""
    tool = on_path(path, tangential=FREE)
    tool.pull(6.0 * axes(tool)[:, 0])
    tool.run(0.4)
    assert tool.fault() == Fault.NONE
    eta, *xi = tool.read("manifold_state")[:3]
    assert 0.01 < eta - 0.1 < 0.05
    assert np.linalg.norm(xi) < 1e-5
    assert not tool.read("limit_force").any()
    slow = on_path(path, tangential=FREE, limits=RobotLimitParameters(speed_share=0.01))
    slow.pull(60.0 * axes(slow)[:, 0])
    slow.run(0.3)
    assert slow.fault() == Fault.NONE
    v = slow.plant.GetVelocities(slow.context)
    share = np.abs(v) / slow.follower.robot.gather("velocity_limit")
    assert share.max() == pytest.approx(0.01, rel=0.02)
    assert slow.read("limit_force").max() > 10.0


@pytest.mark.slow
def test_a_tool_yields_across_a_surface_like_its_spring():
    surface = paraboloid([(-0.3, 0.3), (-0.3, 0.3)], 0.5, [0.9, 0.0, 0.7])
    builder = DiagramBuilder()
    plant = load(builder)
    motion = straight_lines([[0.1, 0.0], [0.11, 0.0]], velocity=0.1, acceleration=1.0)
    follower = add_surface_following(
        builder,
        plant,
        "tool_point",
        surface,
        motion,
        "rigid",
        options=options(transversal=SPRING),
    )
    tool = Pulled(builder, plant, follower)
    normal = axes(tool)[:, 2]
    tool.pull(-15.0 * normal)
    tool.run(0.8)
    assert tool.fault() == Fault.NONE
    force = axes(tool)[:, 2] @ (-15.0 * normal)
    assert tool.read("manifold_state")[2] == pytest.approx(force / 2500.0, rel=0.01)


@pytest.mark.slow
def test_what_yields_can_do_without_a_sensor_before_torques(path):
    """There is no port for a wrench then."""
    builder = DiagramBuilder()
    plant = load(builder)
    chosen = FollowerOptions(compliance=ComplianceParameters(source="observed", transversal=SPRING))
    follower = add_path_following(builder, plant, "tool_point", path, "rigid", options=chosen)
    assert not follower.HasInputPort("wrench")
    assert follower.HasOutputPort("manifold_force")


def test_velocity_servos_tell_no_torques_that_forces_are_found_from(path):
    builder = DiagramBuilder()
    plant = load(builder)
    chosen = FollowerOptions(compliance=ComplianceParameters(source="observed", transversal=SPRING))
    with pytest.raises(InputError, match=r"compliance.source = observed with .*velocity_servo"):
        add_path_following(builder, plant, "tool_point", path, "velocity_servo", options=chosen)


class Asked(Exception):
    """Arguments of the call."""


def ask(*given, **more):
    raise Asked(*given, *more.values())


def impedance_law(kinds, **impedances):
    coordinates = [
        Coordinate(f"{kind.value}_{i}", kind, f"force_{i}") for i, kind in enumerate(kinds)
    ]
    return ImpedanceLaw(ImpedanceParameters(**impedances), coordinates, 2, 1e-3), coordinates


def test_a_tool_that_presses_swings_on_no_spring():
    """The stiffest spring without oscillation for mass and damping across."""
    across = CoordinateImpedance(Profile(2.0), Profile(80.0), Profile(0.0))
    kinds = [Kind.TANGENTIAL, Kind.TANGENTIAL, Kind.TRANSVERSAL]
    law, coordinates = impedance_law(kinds, tangential=FREE, transversal=across)
    compliance = SimpleNamespace(press=SimpleNamespace(over_time=ask))
    with pytest.raises(Asked) as asked:
        compliance_module._add_press(None, compliance, law, coordinates, {}, 7.0)
    assert asked.value.args == (7.0, 80.0**2 / 8.0)


def test_what_is_rigid_is_made_soft_with_the_mass_along(monkeypatch):
    turning = CoordinateImpedance(Profile(0.2), Profile(2.0), Profile(30.0))
    kinds = [Kind.TANGENTIAL, Kind.TRANSVERSAL, Kind.TRANSVERSAL, Kind.ROTATIONAL]
    law, coordinates = impedance_law(kinds, tangential=FREE, rotational=turning)
    monkeypatch.setattr(compliance_module, "ImpedanceTuner", ask)
    ports = dict.fromkeys(("impedance_request", "manifold_state", "desired_reference"))
    impedance = SimpleNamespace(GetOutputPort=lambda name: None)
    with pytest.raises(Asked) as asked:
        compliance_module._add_tuner(None, None, coordinates, law, impedance, ports)
    np.testing.assert_array_equal(asked.value.args[3], [3.0, 3.0, 3.0, 0.2])


def test_limits_that_are_off_limit_nobody(monkeypatch):
    monkeypatch.setattr(compliance_module, "GuidedMotion", lambda *_: "limits")
    monkeypatch.setattr(compliance_module, "RobotLimits", lambda *_, **__: None)
    along = PathManifold(2, oriented=False)
    for tangential, on, expected in (
        (FREE, True, "limits"),
        (FREE, False, None),
        (None, True, None),
    ):
        compliance = ComplianceParameters(
            tangential=tangential or CoordinateImpedance(), limits=RobotLimitParameters(on=on)
        )
        found = compliance_module._limits(compliance, along, None, np.zeros(3), 1e-3)
        assert found == expected
