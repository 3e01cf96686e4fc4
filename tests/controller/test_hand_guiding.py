"""Hand guiding of a user's own plant outside of regions: one call, and refused options."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import (
    Fixture,
    FollowerOptions,
    GuidanceOptions,
    Guide,
    Path,
    SphereRegion,
    add_guidance,
)
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.control.fixtures.record import Mode
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.controller.hand_guiding import _with_force
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.moving import CurveMotion, ShiftedRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.robot.models.files import models_directory
from tests.controller.pulled import Pulled

START = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.9, 0.0, 0.8])
FLOOR = HalfSpace([0.0, 0.0, 0.795], [0.0, 0.0, 1.0])
MASS, DAMPING = 3.0, 60.0
RISE = {"velocity": 0.2, "acceleration": 4.0}  # m/s, m/s^2


def load(builder, name="comau_racer_1_4"):
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(next(models_directory().glob(f"*/{name}.sdf"))))
    plant.Finalize()
    return plant


def led(regions, law="rigid", model="comau_racer_1_4", options=None, start=START, guides=()):
    """Return a guided tool at the start."""
    builder = DiagramBuilder()
    plant = load(builder, model)
    follower = add_guidance(
        builder, plant, "tool_point", regions, law, guides=guides, start=start, options=options
    )
    return Pulled(builder, plant, follower)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ("elastic", ("measured", 200.0)),
        ("rigid", ("measured", 0.0)),
        ("velocity_servo", ("none", 0.0)),
    ],
)
def test_laws_of_torques_are_told_of_the_hand(law, told):
    """With derivatives where those count."""
    for tells, expected in ((True, told), (False, ("none", 0.0))):
        torque = _with_force(GuidanceOptions(tells_law=tells), law).controller.external_torque
        assert (torque.source, torque.bandwidth) == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "model"),
    [
        ("rigid", "comau_racer_1_4"),
        ("elastic", "comau_racer_1_4_elastic"),
        ("rigid", "franka_emika_panda"),
    ],
)
def test_a_hand_feels_the_mass_and_damping_that_are_given(law, model):
    """From rest ``v' = (f - d v) / m``, after the filter's lags; and it does not turn."""
    tool = led([], law, model, start=None if model == "franka_emika_panda" else START)
    force, time = np.array([3.0, -6.0, 4.0]), 0.25
    start = tool.pose()
    tool.pull(force)
    tool.run(time)
    assert tool.fault() == Fault.NONE
    rate, lag = DAMPING / MASS, tool.follower.followed.command_dynamics.lag
    later = time - lag - 1.5e-3
    way = force / DAMPING * (later - (1.0 - np.exp(-rate * later)) / rate)
    moved = tool.pose().translation() - start.translation()
    np.testing.assert_allclose(moved, way, rtol=0.01, atol=1e-5)
    turned = tool.pose().rotation().inverse() @ start.rotation()
    assert np.abs(turned.matrix() - np.eye(3)).max() < 1e-4


@pytest.mark.slow
def test_a_hard_region_holds_the_tool_and_a_soft_one_gives_way():
    """On the floor against 12 N; the soft one by f / k."""
    held = {}
    for name, region in {"hard": FLOOR, "soft": Fixture(FLOOR, stiffness=6e3)}.items():
        tool = led([region])
        tool.pull([4.0, 0.0, -12.0])
        tool.run(0.5)
        assert tool.fault() == Fault.NONE
        assert name == "soft" or tool.read("mode")[0] == Mode.SURFACE
        held[name] = FLOOR.distance(*tool.pose().translation())[0]
        assert tool.pose().translation()[0] > START.translation()[0] + 0.01
    assert abs(held["hard"]) < 2e-5
    assert held["soft"] == pytest.approx(-12.0 / 6e3, rel=0.02)


@pytest.mark.slow
def test_a_region_that_rises_lifts_the_tool():
    """A floor that is 20 mm higher after 0.2 s, against a hand that presses with 6 N."""
    rises = ShiftedRegion(FLOOR, CurveMotion(rest_to_rest([0.0, 0.02], **RISE)), [0.0, 0.0, 1.0])
    tool = led([rises], options=GuidanceOptions(bandwidth=150.0))
    tool.pull([0.0, 0.0, -6.0])
    lowest = np.inf
    for time in np.arange(0.01, 0.5, 0.01):
        tool.run(time)
        lowest = min(lowest, rises.distance_at(*tool.pose().translation(), time)[0])
    assert tool.fault() == Fault.NONE
    assert -6e-5 < lowest < 0.0  # what the law misses of the reference
    assert tool.pose().translation()[2] == pytest.approx(0.815, abs=1e-4)


@pytest.mark.slow
def test_a_path_attracts_the_tool_until_the_hand_pulls_it_away():
    """Beside it the hand's 8 N are the spring's; along it they are the admittance's."""
    p, aside = START.translation(), np.array([0.0, 0.3, 0.0])
    line = Path(PiecewisePolynomialCurve.line(p - aside, p + aside))
    guide = Guide(line, stiffness=3e3, reach=0.05)
    tool = led([], guides=[guide])
    tool.pull([0.0, 4.0, 8.0])
    tool.run(0.6)
    assert tool.fault() == Fault.NONE
    fields, told = GuideRecord(1).fields, tool.read("guides")
    assert told[fields["active"]][0] == 0.0
    moved = tool.pose().translation() - p
    d = moved[2]
    assert 3e3 * d * (1.0 - d**2 / 0.05**2) ** 2 == pytest.approx(8.0, rel=0.02)
    assert moved[1] > 0.01 and abs(moved[0]) < 2e-4
    assert told[fields["eta"]][0] == pytest.approx(0.3 + moved[1], abs=2e-3)
    tool.pull([0.0, 0.0, 1.8 * guide.largest_force])
    tool.run(0.9)
    assert tool.read("guides")[fields["active"]][0] == -1.0


@pytest.mark.slow
def test_without_the_hands_force_told_the_law_lets_it_push_the_tool():
    """Benefit of `tells_law`: without it the tool is pushed into the floor."""
    depths = []
    for tells in (True, False):
        tool = led([FLOOR], options=GuidanceOptions(tells_law=tells))
        tool.pull([0.0, 0.0, -30.0])
        tool.run(0.5)
        depths.append(-FLOOR.distance(*tool.pose().translation())[0])
    assert depths[0] < 2e-5
    assert depths[1] > 1e-4


@pytest.mark.slow(but="False-9")
@pytest.mark.parametrize(
    ("tells", "fault"), [(True, Fault.INPUT_NOT_FINITE), (False, Fault.FORCE_SENSOR_LOST)]
)
def test_a_wrench_that_is_no_number_stops_the_robot(tells, fault):
    """Whether it is the law that misses it or the guidance alone."""
    tool = led([FLOOR], options=GuidanceOptions(tells_law=tells))
    tool.run(0.01)
    tool.pull([np.nan, 0.0, 0.0], felt=np.zeros(3))
    tool.run(0.02)
    assert tool.fault() == fault


@pytest.mark.slow
def test_more_regions_than_eight_are_looked_at_in_turn():
    """The floor is the ninth; balls are far away."""
    balls = [SphereRegion([0.9, 0.3 + 0.2 * k, 1.3], 0.05, inside=False) for k in range(8)]
    tool = led([*balls, FLOOR])
    tool.pull([0.0, 0.0, -12.0])
    tool.run(0.3)
    assert tool.fault() == Fault.NONE
    assert abs(FLOOR.distance(*tool.pose().translation())[0]) < 2e-5


def test_it_steps_without_drake():
    tool = led([FLOOR])
    stepper = tool.follower.stepper()
    tool.pull([0.0, 0.0, -12.0])
    for k in range(15):
        told = stepper.step(plant_state=tool.state(), wrench=[0.0, 0.0, -12.0, 0.0, 0.0, 0.0])
        np.testing.assert_array_equal(told["drive_torque"], tool.read("drive_torque"))
        tool.run((k + 1) * tool.follower.period)


@pytest.mark.slow
def test_servos_are_told_velocities_along_the_pull():
    builder = DiagramBuilder()
    plant = load(builder)
    options = GuidanceOptions(servo_lag=0.004, servo_delay=0.002)
    follower = add_guidance(
        builder, plant, "tool_point", [], "velocity_servo", start=START, options=options
    )
    assert follower.followed.command_dynamics.lag == pytest.approx(0.006)
    stepper = follower.stepper()
    for _ in range(2):
        told = stepper.step(plant_state=follower.start_state, wrench=[30.0, 0, 0, 0, 0, 0])
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, follower.start_posture)
    plant.SetVelocities(context, told["velocity_reference"])
    frame = plant.GetFrameByName("tool_point")
    V = frame.CalcSpatialVelocityInWorld(context)
    speed = 1e-3 * 30.0 / (MASS + 1e-3 * DAMPING)
    np.testing.assert_allclose(V.translational(), [speed, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(V.rotational(), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"law": "rigit"}, "law = rigit; allowed: velocity_servo, rigid"),
        ({"regions": [SphereRegion([0.9, 0.0, 0.8], 0.1, inside=False)]}, r"of regions\[0\]"),
        ({"regions": [FLOOR, FLOOR]}, r"regions\[0\].*regions\[1\]"),
        pytest.param(
            {"start": RigidTransform([9.0, 0.0, 0.0])}, "^start: ", marks=pytest.mark.slow
        ),
        ({"options": dc.replace(GuidanceOptions(), servo_lag=-1.0)}, "servo_lag = -1"),
        (
            {"options": GuidanceOptions(compliance=FollowerOptions().compliance)},
            "compliance.tangential: .* a constant mass",
        ),
    ],
)
def test_what_is_refused(changes, message):
    builder = DiagramBuilder()
    given = {"law": "rigid", "start": START} | changes
    with pytest.raises(InputError, match=message):
        add_guidance(builder, load(builder), "tool_point", **given)
