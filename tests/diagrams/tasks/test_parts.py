"""Paths and laws made from what a scenario says."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.scenario.schema import (
    BentLemniscate,
    Circle,
    ControllerParameters,
    GainParameters,
    Keyframe,
    LawGains,
    Line,
    OrientationParameters,
    PathParameters,
    Waypoints,
)
from diagrams.tasks.parts import make_law, make_path
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.errors import InputError

# an arc of a helix, radius 0.3 m, with the tool tilted more and more
ANGLE = np.linspace(0.0, 2.0, 9)
POSITIONS = np.stack([0.3 * np.cos(ANGLE), 0.3 * np.sin(ANGLE), 0.1 * ANGLE], axis=1)
ZYX = np.stack([0.1 * ANGLE, 0.2 * ANGLE, np.full(9, 0.3)], axis=1)


def write_csv(folder, columns, rows, name="points.csv"):
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows.tolist())]
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return name


def make(shape, keyframes=(), law="elastic", folder=None, convention="zyx"):
    orientation = OrientationParameters(convention, list(keyframes))
    return make_path(PathParameters(shape, orientation), law, folder)


def positions(path, theta):
    return path.position.derivatives(theta, 0)[:, 0]


def test_line():
    path = make(Line([0.1, 0.2, 0.3], [0.1, 0.2, 0.9]))
    assert not path.closed
    assert path.length == pytest.approx(0.6, abs=1e-12)
    expected = [[0.1, 0.2, 0.3 + s] for s in (0.0, 0.25, 0.6)]
    np.testing.assert_allclose([path.pose(s)[0] for s in (0.0, 0.25, 0.6)], expected, atol=1e-12)


def test_circle():
    shape = Circle([0.5, 0.1, 1.0], 0.2, axis_u=[0.0, 2.0, 0.0], axis_v=[0.0, 1.0, 3.0])
    path = make(shape)
    assert path.closed
    assert path.length == pytest.approx(2.0 * math.pi * 0.2, abs=1e-10)
    theta = np.linspace(0.0, 6.0, 7)
    y, z = np.cos(theta), np.sin(theta)
    expected = [0.5, 0.1, 1.0] + 0.2 * np.stack([0.0 * y, y, z], axis=1)
    np.testing.assert_allclose(positions(path, theta), expected, atol=1e-14)


def test_bent_lemniscate():
    path = make(BentLemniscate())
    assert path.closed
    theta = np.linspace(0.0, 6.0, 13)
    c, s = np.cos(theta), np.sin(theta)
    expected = np.stack([0.7 + 0.25 * c, 0.2 + 0.25 * s * c, 1.103 + 0.1 * s**2], axis=1)
    np.testing.assert_allclose(positions(path, theta), expected, atol=1e-14)
    chords = np.diff(positions(path, np.linspace(0.0, 2.0 * math.pi, 200_001)), axis=0)
    assert path.length == pytest.approx(np.linalg.norm(chords, axis=1).sum(), rel=1e-8)


@pytest.mark.parametrize("parametrization", ["chord", "centripetal"])
def test_waypoints_are_visited(tmp_path, parametrization):
    folder = tmp_path / "mine"
    folder.mkdir()
    file = write_csv(folder, ["x", "y", "z"], POSITIONS)
    shape = Waypoints(f"mine/{file}", parametrization=parametrization)
    path = make(shape, folder=tmp_path)
    assert not path.closed
    assert path.orientation is None
    distance = [np.linalg.norm(positions(path, [path.project_globally(p).theta]) - p)
                for p in POSITIONS]  # fmt: skip
    assert max(distance) < 1e-12
    # a helix between its waypoints, too
    radius = np.linalg.norm(positions(path, np.linspace(*path.position.domain, 100))[:, :2], axis=1)
    np.testing.assert_allclose(radius, 0.3, atol=1e-4)


def test_closed_waypoints(tmp_path):
    angle = np.arange(8) * math.pi / 4
    points = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    write_csv(tmp_path, ["x", "y", "z"], points)
    path = make(Waypoints("points.csv", closed=True), folder=tmp_path)
    assert path.closed
    assert path.length == pytest.approx(2.0 * math.pi, rel=1e-3)


@pytest.mark.parametrize(
    ("law", "smoothness"), [("rigid", 3), ("visco_elastic", 4), ("elastic", 5)]
)
def test_splines_are_as_smooth_as_the_law_needs(tmp_path, law, smoothness):
    write_csv(tmp_path, ["x", "y", "z"], POSITIONS)
    assert RELATIVE_DEGREE[law] + 1 == smoothness
    path = make(Waypoints("points.csv"), law=law, folder=tmp_path)
    assert path.position.smoothness == smoothness
    smoother = make(Waypoints("points.csv", smoothness=6), law=law, folder=tmp_path)
    assert smoother.position.smoothness == 6
    with pytest.raises(InputError) as caught:
        make(Waypoints("points.csv", smoothness=2), law=law, folder=tmp_path)
    for part in ("C^2", f"C^{smoothness}", f"'{law}'", "theta = "):
        assert part in str(caught.value)


def test_no_keyframes_no_orientation():
    assert make(Line()).orientation is None


def test_one_keyframe_is_kept_everywhere():
    path = make(BentLemniscate(), [Keyframe(0.4, [30.0, 20.0, 10.0])])
    expected = Rotation.from_euler("ZYX", [30.0, 20.0, 10.0], degrees=True).as_matrix()
    for theta in (-1.0, 0.0, 2.0, 9.0):
        np.testing.assert_allclose(path.orientation.rotation_matrix(theta), expected, atol=1e-14)


@pytest.mark.parametrize(("convention", "axes"), [("zyx", "ZYX"), ("zyz", "ZYZ")])
def test_keyframes_are_visited(convention, axes):
    thetas = [0.0, 0.2, 0.5, 0.6, 1.0]
    angles = np.array([[10.0, 40, -20], [60, 50, 0], [90, 70, 30], [80, 60, 90], [20, 50, 120]])
    keyframes = [Keyframe(t, a.tolist()) for t, a in zip(thetas, angles, strict=True)]
    path = make(Line([0, 0, 0], [0, 3, 0]), keyframes, convention=convention)
    expected = Rotation.from_euler(axes, angles, degrees=True).as_matrix()
    reached = [path.pose(3.0 * t)[1] for t in thetas]  # theta is a fraction of the domain
    np.testing.assert_allclose(reached, expected, atol=1e-12)


def test_on_a_closed_path_the_first_keyframe_stands_for_the_end():
    angles = [[170.0, 0.0, 0.0], [190.0, 20.0, 0.0], [200.0, 0.0, 20.0], [180.0, -10.0, 0.0]]
    keyframes = [Keyframe(0.25 * i, a) for i, a in enumerate(angles)]
    path = make(Circle(), keyframes)
    expected = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    reached = path.orientation.rotation_matrix(0.5 * math.pi * np.arange(9))
    np.testing.assert_allclose(reached, expected[[0, 1, 2, 3, 0, 1, 2, 3, 0]], atol=1e-12)
    # smooth over the seam, as the law needs
    before, after = (path.orientation.derivatives(x, 4) for x in (-1e-9, 1e-9))
    np.testing.assert_allclose(before, after, atol=1e-5)


@pytest.mark.parametrize("thetas", [(0.1, 0.5, 1.0), (0.0, 0.5, 0.9), (0.0, 0.5, 1.1)])
def test_keyframes_must_cover_an_open_path(thetas):
    keyframes = [Keyframe(t, [0.0, 0.0, 10.0 * t]) for t in thetas]
    with pytest.raises(InputError) as caught:
        make(Line(), keyframes)
    assert f"{thetas[0]:g} to {thetas[-1]:g}; it must run from 0 to 1" in str(caught.value)


def test_keyframes_must_increase():
    keyframes = [Keyframe(t, [0.0, 0.0, 10.0 * t]) for t in (0.0, 0.6, 0.5, 1.0)]
    with pytest.raises(InputError, match="strictly increase"):
        make(Line(), keyframes)


def test_orientation_of_waypoints_and_keyframes_that_replace_it(tmp_path):
    columns = ["x", "y", "z", "zyx_1", "zyx_2", "zyx_3"]
    write_csv(tmp_path, columns, np.hstack([POSITIONS, ZYX]))
    path = make(Waypoints("points.csv"), folder=tmp_path)
    thetas = [path.project_globally(p).theta for p in POSITIONS]
    expected = Rotation.from_euler("ZYX", ZYX).as_matrix()
    np.testing.assert_allclose(path.orientation.rotation_matrix(thetas), expected, atol=1e-9)
    replaced = make(Waypoints("points.csv"), [Keyframe(0.0, [90.0, 0.0, 0.0])], folder=tmp_path)
    expected = Rotation.from_euler("ZYX", [90, 0, 0], degrees=True).as_matrix()
    np.testing.assert_allclose(replaced.orientation.rotation_matrix(0.2), expected, atol=1e-14)
    np.testing.assert_array_equal(replaced.position.breakpoints, path.position.breakpoints)


def by_poles(*poles):
    return GainParameters(poles=list(poles))


def controller(law, eta, xi, phi=None, **changes):
    gains = {law: LawGains(eta, xi, phi or GainParameters())}
    return ControllerParameters(law=law, gains=gains, **changes)


@pytest.mark.parametrize("law", ["rigid", "visco_elastic", "elastic"])
def test_gains_reach_their_coordinates(load_arm, law):
    r = RELATIVE_DEGREE[law]
    coefficients = np.poly([-7.0 - k for k in range(r)])[:0:-1]
    eta, xi = [-20.0 - k for k in range(r)], [-30.0] * r
    parameters = controller(
        law, by_poles(*eta), by_poles(*xi), GainParameters(coefficients=coefficients.tolist())
    )
    law = make_law(parameters, load_arm("comau_racer_1_4_elastic").chain, True)
    expected = [np.poly(poles)[:0:-1] for poles in (eta, xi, xi)] + [coefficients] * 3
    np.testing.assert_allclose(law.stabilization.proportional.T, expected, rtol=1e-12)
    assert not law.stabilization.has_integral_part
    assert law.linearization.relative_degree == r


def test_integral_part(load_arm):
    eta = GainParameters(coefficients=[900.0, 60.0], integral=500.0)
    law = make_law(
        controller("rigid", eta, by_poles(-3.0, -3.0)), load_arm("comau_racer_1_4_3r").chain, False
    )
    np.testing.assert_array_equal(law.stabilization.integral, [500.0, 0.0, 0.0])


def test_gains_of_the_law_in_use_are_taken(load_arm):
    parameters = controller("rigid", by_poles(-3.0, -3.0), by_poles(-4.0, -4.0))
    parameters.gains["elastic"] = LawGains()  # of another law: not looked at
    law = make_law(parameters, load_arm("comau_racer_1_4_3r").chain, False)
    expected = [[9, 6], [16, 8], [16, 8]]
    np.testing.assert_allclose(law.stabilization.proportional.T, expected, rtol=1e-12)


def test_limits_are_those_of_the_model_scaled(load_arm):
    chain = load_arm("comau_racer_1_4_3r").chain
    parameters = controller("rigid", by_poles(-3, -3), by_poles(-3, -3), effort_scale=0.5)
    np.testing.assert_array_equal(make_law(parameters, chain, False).limits, [900, 900, 450])


@pytest.mark.parametrize(
    ("parameters", "parts"),
    [
        (ControllerParameters("rigid"), ("controller.gains", "'rigid'", "none")),
        (
            ControllerParameters("rigid", {"elastic": LawGains()}),
            ("controller.gains", "'rigid'", "given are elastic"),
        ),
        (controller("rigid", by_poles(-1, -1), GainParameters()), ("gains.rigid.xi", "needs 2")),
        (
            controller("rigid", GainParameters(coefficients=[1.0]), by_poles(-1, -1)),
            ("controller.gains.rigid.eta", "1 coefficients", "needs 2"),
        ),
        (controller("rigid", by_poles(-1, -1), by_poles(-1)), ("xi", "1 gains", "needs 2")),
        (controller("rigid", by_poles(-1, 0), by_poles(-1, -1)), ("eta", "not Hurwitz")),
        (
            controller(
                "rigid",
                GainParameters(coefficients=[1.0, 1.0], integral=1.5),
                by_poles(-1, -1),
            ),
            ("eta", "a_0 = 1.5", "not Hurwitz"),
        ),
        (
            controller("rigid", by_poles(-1, -1), by_poles(-1, -1), max_alpha=1.5),
            ("max_alpha", "1.5"),
        ),
        (
            controller("rigid", by_poles(-1, -1), by_poles(-1, -1), min_rcond=0.0),
            ("min_rcond", "0.0"),
        ),
    ],
)
def test_refused_controllers(load_arm, parameters, parts):
    with pytest.raises(InputError) as caught:
        make_law(parameters, load_arm("comau_racer_1_4_3r").chain, False)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("damping", [[], [0.04], [0.04, -0.04, 0.02], [0.04, 0.0, 0.02]])
def test_boundary_layer_damping_suits_the_robot(load_arm, damping):
    poles = by_poles(-30.0, -30.0)
    parameters = controller("singular_perturbation", poles, poles)
    chain = load_arm("comau_racer_1_4_elastic_3r").chain
    parameters.boundary_layer_damping = [0.04, 0.04, 0.02]
    make_law(parameters, chain, False)
    parameters.boundary_layer_damping = damping
    with pytest.raises(InputError, match=r"boundary_layer_damping.*3 positive"):
        make_law(parameters, chain, False)
