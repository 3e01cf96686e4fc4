"""Every option of a controller changes it, or is refused in one line that names it."""

import dataclasses as dc
from functools import cache

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder

from pfsc_drake import (
    ComplianceParameters,
    ControllerParameters,
    CoordinateImpedance,
    Extension,
    FaultParameters,
    Fixture,
    FollowerOptions,
    GainParameters,
    GuidanceOptions,
    InputError,
    LawGains,
    MotionLimits,
    ObstacleOptions,
    ObstacleShape,
    OperatorOptions,
    Profile,
    SphereRegion,
    StreamLimits,
    Swing,
    WaypointTable,
    add_guidance,
    add_path_following,
    add_path_streaming,
    add_surface_following,
    models_directory,
    path_from_waypoints,
    straight_lines,
)
from pfsc_drake.blocks.wiring_blocks import Constant
from pfsc_drake.compiled.content import NoContentError, content
from pfsc_drake.control.compliance.pressing import PressParameters
from pfsc_drake.control.estimation.link_deviation import StateUncertainty
from pfsc_drake.controller.options.controller_parameters import ExternalTorqueParameters
from pfsc_drake.controller.options.follower_options import BrakeParameters
from pfsc_drake.geometry import plane
from pfsc_drake.physics.friction import FrictionDrift

POINTS = [[0.9, -0.3, 0.8], [1.0, 0.0, 0.9], [0.9, 0.3, 0.8], [0.8, 0.0, 0.75]]
SOFT = CoordinateImpedance(Profile(3.0), Profile(60.0), Profile(500.0))
FREE = CoordinateImpedance(Profile(3.0), Profile(60.0), Profile(0.0))


class Constantly(Extension):
    """Adds one block."""

    def after_law(self, assembly):
        assembly.add("one", Constant([1.0]))


# another value of options whose type does not tell one
OTHERS = {
    "controller.law": "visco_elastic",
    "controller.manifold": "trajectory",
    "controller.model": "no_such_model",
    "controller.state": "observed",
    "controller.state_uncertainty": StateUncertainty(0.3),
    "controller.boundary_layer_damping": [0.01] * 3,
    "controller.damped_below": 0.01,
    "controller.delay": 2e-3,
    "controller.gains": {"rigid": LawGains(eta=GainParameters(bandwidth=17.0))},
    "controller.external_torque.source": "known",
    "controller.friction.source": "observer",
    "controller.friction.observer": "kalman",
    "controller.friction.velocity": "reference",
    "controller.friction.kalman.intervals": "begin",
    "controller.friction.nominal.f_c": [3.0],
    "controller.friction.nominal.f_v": [3.0],
    "controller.friction.nominal.file": "comau_racer_1_4",
    "controller.friction.nominal.drift": FrictionDrift(),
    "controller.posture.task": "limits",
    "controller.posture.reference_deg": [5.0] * 6,
    "controller.posture.weight": "range",
    "controller.posture.joint_weights": [1.0, 2.0, 3.0, 1.0, 1.0, 1.0],
    "controller.posture.elbow_joints": [1, 3, 5],
    "controller.posture.yields": "known",
    "faults.saturation_time": 0.3,
    "faults.brakes": None,
    "friction": (np.full(3, 2.0), np.full(3, 5.0)),
    "posture": np.array([0.2, 0.3, 0.4]),
    "compliance.source": "observed",
    "compliance.tangential": SOFT,
    "compliance.transversal": SOFT,
    "compliance.rotational": SOFT,
    "compliance.press": PressParameters(),
    "stream": StreamLimits(),
    "swings": [Swing()],
    "reference": MotionLimits(speed="fastest", torque_rate=1e5),
    "obstacles": ObstacleOptions([ObstacleShape("person", 0.2)]),
    "measures": "joint_state",
    "frame": np.array([0.01, 0.0, 0.0, *np.eye(3).ravel()]),
    "fixtures.distance_evaluations": 2,
    "operator": OperatorOptions(),
    "known_forces": ("wrench_ext",),
    "frame_motion": lambda: None,
    "extensions": [Constantly()],
}
# blocks that are changed as a whole
WHOLE = (CoordinateImpedance, StateUncertainty)


@cache
def plant_of(model):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(models_directory() / "comau_racer_1_4" / f"{model}.sdf"))
    plant.Finalize()
    return plant


@cache
def closed_path():
    return path_from_waypoints(WaypointTable(np.array(POINTS)), smoothness=6, closed=True)


def follow(options, law="rigid", model="comau_racer_1_4_3r"):
    """Return a controller along a path without orientation, of three joints by default."""
    return add_path_following(
        DiagramBuilder(), plant_of(model), "tool_point", closed_path(), law, options=options
    )


def follow_open(options):
    """Return the like along a path with ends."""
    y = np.linspace(-0.2, 0.2, 8)
    points = np.stack([0.9 + 0.2 * y**2, y, 0.8 + 0.0 * y], axis=-1)
    path = path_from_waypoints(WaypointTable(points), smoothness=3)
    place = plant_of("comau_racer_1_4_3r"), "tool_point", path, "rigid"
    return add_path_following(DiagramBuilder(), *place, options=options)


def slide(options, law="rigid"):
    """Return the like on a surface."""
    motion = straight_lines([[0.0, 0.0], [0.1, 0.1]], velocity=0.1, acceleration=0.5)
    sheet = plane([0.4, 0.4], [0.9, 0.0, 0.8])
    place = plant_of("comau_racer_1_4_3r"), "tool_point", sheet, motion, law
    return add_surface_following(DiagramBuilder(), *place, options=options)


def guide(options, law="rigid"):
    """Return the like in space, with a soft region."""
    ball = Fixture(SphereRegion([1.0, 0.0, 0.1], 0.1, inside=False), stiffness=4e3)
    place = plant_of("comau_racer_1_4_3r"), "tool_point", [ball], law
    return add_guidance(DiagramBuilder(), *place, oriented=False, options=options)


def stream(options, law="rigid"):
    """Return the like along a path of waypoints that come."""
    place = plant_of("comau_racer_1_4_3r"), "tool_point", [0.9, 0.0, 0.8], law
    return add_path_streaming(DiagramBuilder(), *place, options=options)


def shape(follower):
    """Return all that decides what a controller does."""

    def systems(diagram):
        for system in diagram.GetSystems():
            if isinstance(system, Diagram):
                yield from systems(system)
            else:
                yield system

    def told(system):
        try:
            return content((system.get_name(), getattr(system, "block", None)))
        except NoContentError:  # what takes waypoints holds itself
            return system.get_name()

    blocks = [told(system) for system in systems(follower)]
    ports = [follower.get_input_port(i).get_name() for i in range(follower.num_input_ports())]
    return content((blocks, ports, follower.start_posture))


def leaves(options, key=""):
    """Iterate over the keys of all options, including nested blocks, with their values."""
    for field in dc.fields(options):
        value, name = getattr(options, field.name), f"{key}{field.name}"
        if dc.is_dataclass(value) and not isinstance(value, WHOLE):
            yield from leaves(value, f"{name}.")
        else:
            yield name, value


def other(key, value):
    """Return another value that is allowed."""
    if key in OTHERS:
        return OTHERS[key]
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return 0.75 * value if value else 0.5
    assert isinstance(value, list), key  # else it needs a place in OTHERS
    return [0.75 * x for x in value] or [0.5]


def changed(options, key, value):
    """Return options with one changed; as a user writes it, which checks the blocks around."""
    name, _, below = key.partition(".")
    if below:
        value = changed(getattr(options, name), below, value)
    return dc.replace(options, **{name: value})


BASES = {
    "path": (follow, FollowerOptions()),
    "servo": (lambda options: follow(options, "velocity_servo"), FollowerOptions()),
    "surface": (slide, FollowerOptions()),
    "space": (guide, GuidanceOptions(posture=np.full(3, 0.3))),
    "servo in space": (
        lambda options: guide(options, "velocity_servo"),
        GuidanceOptions(posture=np.full(3, 0.3)),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
def test_every_option_acts_or_is_refused(base):
    make, options = BASES[base]
    plain = shape(make(options))
    silent, unnamed = [], []
    # a hand's force as it is known is what the law is told of anyhow
    same = {"controller.external_torque.source"} if base == "space" else set()
    for key, value in leaves(options):
        try:
            if shape(make(changed(options, key, other(key, value)))) == plain:
                silent.append(key)
        except InputError as error:
            named = [name for name in key.split(".") if name in str(error)]
            if "\n" in str(error) or not named:
                unnamed.append((key, str(error)))
    assert set(silent) == same and unnamed == []


DAMPED = FollowerOptions(controller=ControllerParameters(boundary_layer_damping=[0.02] * 3))
SENSED = ComplianceParameters(tangential=FREE, transversal=SOFT)
OBSERVED = dc.replace(SENSED, source="observed")
MODEL = changed(
    FollowerOptions(friction=(np.full(3, 1.0), np.full(3, 4.0))),
    "controller.friction.source",
    "model",
)
OBSERVER = changed(FollowerOptions(), "controller.friction.source", "observer")
KALMAN = changed(
    MODEL, "controller.friction", dc.replace(OBSERVER.controller.friction, observer="kalman")
)


def redundant(options):
    """Return a controller of six joints for three outputs."""
    return follow(options, model="comau_racer_1_4")


def elastic(options):
    """Return a controller of elastic joints."""
    return follow(options, "elastic", "comau_racer_1_4_elastic_3r")


def composite(options):
    """Return a controller by the composite law."""
    return follow(options, "singular_perturbation", "comau_racer_1_4_elastic_3r")


# options that act where others are chosen, and what is chosen
CONDITIONAL = [
    (follow, FollowerOptions(compliance=SENSED), "compliance", ["source", "tangential"]),
    (follow, FollowerOptions(compliance=OBSERVED), "compliance.observed", None),
    (follow, FollowerOptions(compliance=SENSED), "compliance.limits", None),
    (follow, MODEL, "controller.friction", ["smoothing", "velocity", "hold_at_rest"]),
    (follow, MODEL, "", ["friction"]),
    (follow, OBSERVER, "controller.friction", ["rate"]),
    (follow, KALMAN, "controller.friction", ["smoothing", "velocity"]),
    (follow, KALMAN, "controller.friction.kalman", None),
    (redundant, FollowerOptions(), "controller.posture", ["task", "weight", "inertia", "damping"]),
    (redundant, FollowerOptions(), "controller.posture", ["reference_deg", "joint_weights"]),
    (redundant, FollowerOptions(), "controller.posture", ["stiffness", "filter_rate", "yields"]),
    (elastic, FollowerOptions(), "", ["bandwidth"]),
    (follow_open, FollowerOptions(), "controller", ["max_beyond_end"]),
    (follow, FollowerOptions(), "faults", ["brakes"]),
    (composite, DAMPED, "controller", ["boundary_layer_damping"]),
    (guide, BASES["space"][1], "fixtures.limits", None),
    (guide, BASES["space"][1], "fixtures.guidance", ["approach_time", "braking", "largest_speed"]),
    (BASES["servo in space"][0], BASES["servo in space"][1], "", ["servo_lag", "servo_delay"]),
]


@pytest.mark.slow(but="follow-options0-compliance-names0")
@pytest.mark.parametrize(("make", "options", "block", "names"), CONDITIONAL)
def test_options_act_where_they_are_needed(make, options, block, names):
    plain, within = shape(make(options)), options
    for name in filter(None, block.split(".")):
        within = getattr(within, name)
    for name in names or [field.name for field in dc.fields(within)]:
        key = f"{block}.{name}" if block else name
        value = other(key, getattr(within, name))
        assert shape(make(changed(options, key, value))) != plain, key


GAINS = [
    ({"elastic": LawGains()}, "controller.gains: given for elastic, .* the call is rigid"),
    ({"rigid": LawGains(posture=GainParameters(bandwidth=9.0))}, "rigid.posture: given, has no"),
    (
        {"rigid": LawGains(xi=GainParameters(poles=[-9.0, -8.0], bandwidth=9.0))},
        "rigid.xi.bandwidth = 9: has no effect beside poles",
    ),
    (
        {"rigid": LawGains(xi=GainParameters(bandwidth=9.0, tolerated_error=0.1))},
        "rigid.xi.tolerated_error = 0.1: has",
    ),
]


@pytest.mark.parametrize(("gains", "message"), GAINS)
def test_gains_that_the_law_does_not_use_are_refused(gains, message):
    with pytest.raises(InputError, match=message):
        follow(FollowerOptions(controller=ControllerParameters(gains=gains)))


def test_a_bandwidth_beside_gains_of_all_coordinates_is_refused():
    given = LawGains(eta=GainParameters(bandwidth=9.0), xi=GainParameters(bandwidth=9.0))
    controller = ControllerParameters(gains={"rigid": given})
    follow(FollowerOptions(controller=controller))
    with pytest.raises(InputError, match=r"^bandwidth = 30.0: has no effect; needs coordinates"):
        follow(FollowerOptions(bandwidth=30.0, controller=controller))


def test_resolved_poles_keep_the_bandwidth_that_chose_them():
    """As the resolved scenario of a run has them."""
    given = GainParameters(poles=[-9.0, -9.0], bandwidth=9.0)
    follow(
        FollowerOptions(
            controller=ControllerParameters(gains={"rigid": LawGains(eta=given, xi=given)})
        )
    )


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (
            composite,
            FollowerOptions(controller=ControllerParameters(law="elastic", model="mine.sdf")),
            "controller.model = mine.sdf: has no effect; the plant of the call is the model",
        ),
        (
            follow,
            FollowerOptions(faults=FaultParameters(brakes=BrakeParameters(torque=[50.0]))),
            r"faults.brakes.torque = \[50.0\]: has no effect; it is the plant's",
        ),
        (guide, GuidanceOptions(override=True), "override = True: has no effect; needs a path"),
        (
            guide,
            GuidanceOptions(
                tells_law=False,
                controller=ControllerParameters(
                    external_torque=ExternalTorqueParameters("measured")
                ),
            ),
            "tells_law = False: has no",
        ),
        (
            stream,
            FollowerOptions(obstacles=OTHERS["obstacles"]),
            "obstacles = given: has no effect",
        ),
        (follow, FollowerOptions(friction=OTHERS["friction"]), "friction = given: has no effect"),
    ],
)
def test_messages_name_the_option_and_what_it_needs(make, options, message):
    with pytest.raises(InputError, match=message) as caught:
        make(options)
    assert "\n" not in str(caught.value)
