"""Laws made from what a scenario says."""

import re

import numpy as np
import pytest

from diagrams.scenario import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.controller import law as law_module
from pfsc_drake.controller.law import make_law, safe_state, sampled_robot, supervision
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.follower_options import FaultParameters
from pfsc_drake.errors import InputError


def by_poles(*poles):
    return GainParameters(poles=list(poles))


def controller(law, eta, xi, phi=None, **changes):
    gains = {law: LawGains(eta, xi, phi or GainParameters())}
    return ControllerParameters(law=law, gains=gains, **changes)


def make(parameters, robot, *, oriented=False):
    manifold = PathManifold(RELATIVE_DEGREE[parameters.law], oriented=oriented)
    return make_law(parameters, robot, manifold)


@pytest.mark.slow(but="visco_elastic")
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


def test_torques_that_lead(load_arm):
    eta = by_poles(-20.0, -20.0)
    for leads, lead in ((False, 0.0), (True, 0.5)):
        parameters = controller("rigid", eta, eta, torque_lead=leads)
        assert make(parameters, load_arm("comau_racer_1_4_3r").chain).linearization.lead == lead
    with pytest.raises(InputError, match="torque_lead = True; allowed: false except with the law"):
        ControllerParameters("elastic", torque_lead=True)


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


def test_after_a_fault_motors_are_braked_by_their_scaled_limits(load_arm):
    parameters = ControllerParameters("rigid", effort_scale=0.5, brake_damping=0.1)
    faults = FaultParameters(hold_bandwidth=35.0, effort_share=0.6)
    found = safe_state(parameters, load_arm("comau_racer_1_4_3r").chain, faults)
    np.testing.assert_allclose(found.damping, [90.0, 90.0, 45.0])
    assert (found.bandwidth, found.effort_share) == (35.0, 0.6)


def test_what_is_watched_knows_how_well_motion_is_measured(load_arm):
    nominal = NominalRobot(load_arm("comau_racer_1_4_3r").chain, resolution=1e-5, filter_time=2e-3)
    watched = supervision("rigid", FaultParameters(), nominal)
    np.testing.assert_array_equal(watched.resolution, np.full(3, 1e-5))
    assert watched.filter_time == 2e-3
    # servos may stay at their limits of velocity, unless somebody minds
    times = [("rigid", None, 0.2), ("velocity_servo", None, 0.0), ("velocity_servo", 0.3, 0.3)]
    for law, given, expected in times:
        found = supervision(law, FaultParameters(saturation_time=given), nominal)
        assert found.saturation_time == expected


def test_poles_are_chosen_for_the_largest_error_and_the_delay(load_arm, monkeypatch):
    """All coordinates, each with its own bandwidth."""
    chain, asked = load_arm("comau_racer_1_4_elastic_3r").chain, []
    monkeypatch.setattr(law_module, "sampled_robot", lambda parameters, *_: parameters.delay)
    monkeypatch.setattr(law_module, "choose_fast_pole", lambda *given: asked.append(given) or 100.0)
    eta, xi = (
        GainParameters(bandwidth=20.0, tolerated_error=0.2),
        GainParameters(bandwidth=30.0, tolerated_error=0.1),
    )
    parameters = controller("elastic", eta, xi, delay=2e-3)
    rest = RestPosture(np.array([0.3, 1.3, -0.5]), np.zeros(1))
    make_law(parameters, chain, PathManifold(4, oriented=False), lambda: rest)
    ((robot, _, bandwidths, error),) = asked
    assert (robot, list(bandwidths), error) == (2e-3, [20.0, 30.0], 0.2)
    for gains, bandwidth in ((eta, 20.0), (xi, 30.0)):
        assert gains.poles[:3] == [-bandwidth, -bandwidth, -100.0]
        assert gains.poles[3] < -100.0


def test_a_law_at_rest_has_its_delay(load_arm, monkeypatch):
    monkeypatch.setattr(law_module, "LoopAtRest", lambda *given: given)
    parameters = ControllerParameters("elastic", delay=3e-3, sampling_time=1e-3)
    chain = load_arm("comau_racer_1_4_elastic_3r").chain
    found = sampled_robot.__wrapped__(parameters, chain, None, None)
    assert found.loop[3:] == (1e-3, None, 3)
    assert found.is_elastic


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
        (
            controller("rigid", by_poles(-1, -1), GainParameters()),
            (
                "gains.rigid.xi: neither poles nor coefficients; allowed: 2 poles (1/s) or 2 "
                "coefficients with the law 'rigid'",
            ),
        ),
        (
            controller("rigid", GainParameters(coefficients=[1.0]), by_poles(-1, -1)),
            (
                "controller.gains.rigid.eta.coefficients = [1.0]; allowed: 2 poles (1/s) or 2 "
                "coefficients with the law 'rigid'",
            ),
        ),
        (
            controller("rigid", by_poles(-1, -1), by_poles(-1)),
            ("controller.gains.rigid.xi.poles = [-1]; allowed: 2 negative numbers",),
        ),
        (
            controller("velocity_servo", GainParameters(free=True), by_poles(-1)),
            ("controller.gains.velocity_servo.eta.free = true", "servos hold every joint"),
        ),
        (
            controller("rigid", by_poles(-1, 0), by_poles(-1, -1)),
            ("controller.gains.rigid.eta.poles = [-1, 0]; allowed: 2 negative numbers",),
        ),
        (
            controller(
                "rigid",
                GainParameters(coefficients=[1.0, 1.0], integral=1.5),
                by_poles(-1, -1),
            ),
            (
                "controller.gains.rigid.eta.coefficients = [1.0, 1.0] with integral = 1.5: not "
                "Hurwitz, pole at 0.",
                "allowed: ",
            ),
        ),
        (
            controller("rigid", by_poles(-1, -1), by_poles(-1, -1), max_alpha=1.5),
            ("controller.max_alpha = 1.5; allowed: above 0, below 1",),
        ),
        (
            controller("rigid", by_poles(-1, -1), by_poles(-1, -1), min_rcond=0.0),
            ("controller.min_rcond = 0.0; allowed: above 0, below 1",),
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


def test_boundary_layer_damping_that_is_offered_is_taken(load_arm):
    poles = by_poles(-30.0, -30.0)
    parameters = controller("singular_perturbation", poles, poles)
    chain = load_arm("comau_racer_1_4_elastic_3r").chain
    for period in (0.0, 1e-3, 0.02):
        parameters.sampling_time = period
        parameters.boundary_layer_damping = []
        with pytest.raises(InputError, match=r"3 positive values \[s\], perhaps") as caught:
            make(parameters, chain)
        offered = [
            float(x) for x in re.findall(r"perhaps \[(.*)\]", str(caught.value))[0].split(",")
        ]
        expected = np.sqrt(2.0 * chain.D_M / chain.K_s)
        if period:
            expected = np.minimum(expected, 0.3 * chain.D_M / (chain.K_s * period))
        np.testing.assert_allclose(offered, expected, rtol=0.06)
        parameters.boundary_layer_damping = offered
        make(parameters, chain)
