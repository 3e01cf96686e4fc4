"""Laws made from what a scenario says."""

import numpy as np
import pytest

from diagrams.scenario import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.following.law import make_law


def by_poles(*poles):
    return GainParameters(poles=list(poles))


def controller(law, eta, xi, phi=None, **changes):
    gains = {law: LawGains(eta, xi, phi or GainParameters())}
    return ControllerParameters(law=law, gains=gains, **changes)


def make(parameters, robot, *, oriented=False):
    manifold = PathManifold(RELATIVE_DEGREE[parameters.law], oriented=oriented)
    return make_law(parameters, robot, manifold)


@pytest.mark.parametrize("law", ["rigid", "visco_elastic", "elastic"])
def test_gains_reach_their_coordinates(load_arm, law):
    r = RELATIVE_DEGREE[law]
    coefficients = np.poly([-7.0 - k for k in range(r)])[:0:-1]
    eta, xi = [-20.0 - k for k in range(r)], [-30.0] * r
    parameters = controller(
        law, by_poles(*eta), by_poles(*xi), GainParameters(coefficients=coefficients.tolist())
    )
    law = make(parameters, load_arm("comau_racer_1_4_elastic").chain, oriented=True)
    expected = [np.poly(poles)[:0:-1] for poles in (eta, xi, xi)] + [coefficients] * 3
    np.testing.assert_allclose(law.stabilization.proportional.T, expected, rtol=1e-12)
    assert not law.stabilization.has_integral_part
    assert law.linearization.relative_degree == r


def test_integral_part(load_arm):
    eta = GainParameters(coefficients=[900.0, 60.0], integral=500.0)
    parameters = controller("rigid", eta, by_poles(-3.0, -3.0))
    law = make(parameters, load_arm("comau_racer_1_4_3r").chain)
    np.testing.assert_array_equal(law.stabilization.integral, [500.0, 0.0, 0.0])


def test_gains_of_the_law_in_use_are_taken(load_arm):
    parameters = controller("rigid", by_poles(-3.0, -3.0), by_poles(-4.0, -4.0))
    parameters.gains["elastic"] = LawGains()  # of another law: not looked at
    law = make(parameters, load_arm("comau_racer_1_4_3r").chain)
    expected = [[9, 6], [16, 8], [16, 8]]
    np.testing.assert_allclose(law.stabilization.proportional.T, expected, rtol=1e-12)


def test_limits_are_those_of_the_model_scaled(load_arm):
    chain = load_arm("comau_racer_1_4_3r").chain
    parameters = controller("rigid", by_poles(-3, -3), by_poles(-3, -3), effort_scale=0.5)
    np.testing.assert_array_equal(make(parameters, chain).limits, [900, 900, 450])


@pytest.mark.parametrize(
    ("parameters", "parts"),
    [
        (ControllerParameters("rigid"), ("controller.gains", "'rigid'", "none")),
        (
            ControllerParameters("rigid", {"elastic": LawGains()}),
            (
                "controller.gains",
                "'rigid'",
                "given are elastic; write rigid: {eta: {poles: [-20.0, -20.0]}, xi: {poles: ",
            ),
        ),
        (controller("rigid", by_poles(-1, -1), GainParameters()), ("gains.rigid.xi", "needs 2")),
        (
            controller("rigid", GainParameters(coefficients=[1.0]), by_poles(-1, -1)),
            ("controller.gains.rigid.eta", "1 coefficients", "needs 2"),
        ),
        (
            controller("rigid", by_poles(-1, -1), by_poles(-1)),
            ("controller.gains.rigid.xi", "1 gains", "needs 2"),
        ),
        (
            controller("velocity_servo", GainParameters(free=True), by_poles(-1)),
            ("controller.gains.velocity_servo.eta.free = true", "servos hold every joint"),
        ),
        (
            controller("rigid", by_poles(-1, 0), by_poles(-1, -1)),
            ("controller.gains.rigid.eta", "not Hurwitz"),
        ),
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
        make(parameters, load_arm("comau_racer_1_4_3r").chain)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("damping", [[], [0.04], [0.04, -0.04, 0.02], [0.04, 0.0, 0.02]])
def test_boundary_layer_damping_suits_the_robot(load_arm, damping):
    poles = by_poles(-30.0, -30.0)
    parameters = controller("singular_perturbation", poles, poles)
    chain = load_arm("comau_racer_1_4_elastic_3r").chain
    parameters.boundary_layer_damping = [0.04, 0.04, 0.02]
    make(parameters, chain)
    parameters.boundary_layer_damping = damping
    with pytest.raises(InputError, match=r"boundary_layer_damping.*3 positive"):
        make(parameters, chain)
