"""Warnings of a station."""

from pathlib import Path

import pytest

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, GainParameters, LawGains
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.robot.robot_model import joint_resonances
from tests.scenarios import shipped_scenario

SCENARIOS = Path(__file__).resolve().parents[2] / "experiments" / "scenarios"


@pytest.fixture(name="scenario")
def fixture_scenario():
    return shipped_scenario("pfc_elastic_3r")


def warnings(scenario):
    """What is said but that the reference is slowed, which is the drives' affair."""
    said = build_station(scenario, SCENARIOS).warnings
    return [sentence for sentence in said if "reference is slowed" not in sentence]


def test_the_shipped_settings_give_no_warning(scenario):
    assert warnings(scenario) == []


@pytest.mark.slow
def test_joints_too_soft_for_the_law(scenario):
    """The tool then leaves the path by tens of millimetres at 1.5 m/s."""
    scenario.controller.boundary_layer_damping = [0.03, 0.03, 0.02]
    for law in ("singular_perturbation", "rigid"):
        scenario.controller.law = law
        (warning,) = warnings(scenario)
        assert "mm for each m/s^2" in warning
        assert "resonate at 14.5 Hz" in warning
        assert "'elastic' or 'visco_elastic'" in warning


@pytest.mark.slow
def test_joints_so_soft_that_the_law_is_unstable(scenario):
    scenario.controller.law = "singular_perturbation"
    scenario.controller.boundary_layer_damping = [0.03, 0.03, 0.02]
    fast = GainParameters(poles=[-60.0, -60.0])
    scenario.controller.gains[scenario.controller.law] = LawGains(fast, fast)
    (warning,) = warnings(scenario)
    assert "unstable" in warning and "slower gains" in warning


@pytest.mark.slow
def test_stiff_joints_suit_both_laws():
    """Deviations of 0.1 mm and less at 0.3 m/s; with the printed damping 0.4 mm."""
    scenario = shipped_scenario("pfc_comau_6r")
    assert warnings(scenario) == []
    tuned = scenario.controller.boundary_layer_damping
    scenario.controller.boundary_layer_damping = [0.022, 0.022, 0.0088, 0.0024, 0.0044, 0.0022]
    (warning,) = warnings(scenario)
    assert "K_s epsilon D_b T_s / D_M is up to 1.56" in warning
    scenario.controller.boundary_layer_damping = tuned
    scenario.controller.gains["rigid"] = scenario.controller.gains["singular_perturbation"]
    scenario.controller.law = "rigid"
    assert warnings(scenario) == []


@pytest.mark.slow
def test_servos_faster_than_the_joints(scenario):
    scenario.controller.law = "velocity_servo"
    slow = GainParameters(poles=[-5.0])
    scenario.controller.gains["velocity_servo"] = LawGains(slow, slow)
    (warning,) = warnings(scenario)
    assert "servo.bandwidth = 200 rad/s" in warning
    station = build_station(scenario, SCENARIOS)
    lowest = joint_resonances(station.robot, station.start_posture)[0]
    assert f"{lowest:.0f} rad/s" in warning
    scenario.servo.bandwidth = 0.99 * lowest
    assert warnings(scenario) == []
    scenario.servo.bandwidth, scenario.robot.model = 900.0, "comau_racer_1_4_3r"
    assert warnings(scenario) == []


@pytest.mark.slow
def test_resonances_too_fast_for_the_elastic_law(scenario):
    # 19 Hz times 50 ms is 6 rad
    scenario.controller.sampling_time = 0.05
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "Hz" in warning and "singular_perturbation" in warning


@pytest.mark.slow
def test_damping_too_strong_for_the_sampling(scenario):
    scenario.controller.law = "singular_perturbation"
    # 35000 Nm/rad * 0.06 s * 1 ms / 4.95 kg m^2 = 0.42
    scenario.controller.boundary_layer_damping = [0.03, 0.06, 0.02]
    warning, _ = warnings(scenario)
    assert "0.42" in warning and "boundary_layer_damping" in warning
    # as printed in Tab. 3.4: 0.31
    scenario.controller.boundary_layer_damping = [0.044, 0.044, 0.0256]
    warning, _ = warnings(scenario)
    assert "0.31" in warning


def test_forces_that_the_elastic_law_does_not_know_of(scenario):
    scenario.forces = [ForcePulse(begin=0.1, end=0.5, force=[5.0, 0.0, 0.0])]
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "external_torque" in warning
    scenario.controller.external_torque.source = "known"
    assert build_station(scenario, SCENARIOS).warnings == []
    scenario.controller.external_torque.source = "none"
    scenario.controller.law = "singular_perturbation"
    assert not any("external_torque" in warning for warning in warnings(scenario))


def test_a_hand_that_the_elastic_law_does_not_know_of(scenario):
    scenario.hand = HandParameters()
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "external_torque" in warning


def with_gains(scenario, **kinds):
    elastic = LawGains(**{kind: GainParameters(**given) for kind, given in kinds.items()})
    scenario.controller.gains["elastic"] = elastic
    return scenario


@pytest.mark.slow
def test_gains_that_are_not_robust_to_model_errors():
    """Four equal poles on six axes: unstable with masses 5 % off, by simulation as well."""
    scenario = shipped_scenario("pfc_elastic_6r")
    assert warnings(scenario) == []
    equal = {"poles": [-55.0] * 4}
    (warning,) = warnings(with_gains(scenario, eta=equal, xi=equal, phi=equal))
    assert "do not tolerate 5 %" in warning
    assert "nominal joint stiffnesses 5 % too high" in warning
    assert "about 1.9 % is tolerated" in warning
    assert "poles: auto" in warning


def test_gains_too_fast_for_the_sampling(scenario):
    fast = {"poles": [-700.0] * 4}
    (warning,) = warnings(with_gains(scenario, eta=fast, xi=fast))
    assert "unstable at the start even on a perfect model" in warning


def test_chosen_poles_are_robust_and_saved():
    scenario = shipped_scenario("pfc_elastic_6r")
    slow, quick = {"bandwidth": 40.0}, {"bandwidth": 60.0, "tolerated_error": 0.08}
    given = with_gains(scenario, eta=slow, xi=quick, phi={"poles": [-50.0, -50.0, -200.0, -300.0]})
    assert warnings(given) == []
    gains = given.controller.gains["elastic"]
    assert gains.eta.poles[:2] == [-40.0, -40.0]
    assert gains.xi.poles[:2] == [-60.0, -60.0]
    assert gains.eta.poles[2:] == gains.xi.poles[2:]
    assert -400.0 < gains.xi.poles[2] < -200.0
    assert gains.phi.poles == [-50.0, -50.0, -200.0, -300.0]
    assert given.controller.gains["elastic"].xi.bandwidth == 60.0


def test_chosen_poles_of_laws_without_fast_ones(scenario):
    scenario.controller.law = "rigid"
    gains = GainParameters(bandwidth=30.0)
    scenario.controller.gains["rigid"] = LawGains(gains, gains)
    build_station(scenario, SCENARIOS)
    assert gains.poles == [-30.0, -30.0]


def test_poles_are_not_chosen_without_a_bandwidth(scenario):
    with pytest.raises(InputError, match=r"gains.elastic.eta: .* poles: auto with a bandwidth"):
        build_station(with_gains(scenario, eta={}, xi={}), SCENARIOS)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"bandwidth": -1.0}, "bandwidth"),
        ({"bandwidth": float("nan")}, "bandwidth"),
        ({"tolerated_error": 0.7}, "tolerated_error"),
        ({"bandwidth": 5.0, "coefficients": [1.0, 2.0]}, "bandwidth"),
    ],
)
def test_refused_ways_to_choose_poles(wrong, key):
    with pytest.raises(InputError, match=key):
        GainParameters(**wrong)


@pytest.mark.slow
def test_observed_forces_tolerate_less_than_the_error_of_the_masses():
    """From 3.5 % (still) to 4 % (swings at 13 Hz) on, simulated with all masses too high."""
    scenario = shipped_scenario("vf_soft_circle")
    scenario.friction, scenario.controller.friction.source = type(scenario.friction)(), "none"
    scenario.model_error = type(scenario.model_error)()
    assert warnings(scenario) == []
    scenario.compliance.source = "observed"
    (warning,) = warnings(scenario)
    assert "tolerates nominal masses 3.9 % too high" in warning
    scenario.compliance.observed.rate = 20.0
    assert warnings(scenario) == []


@pytest.mark.slow
def test_free_angles_make_no_loop_unstable():
    scenario = shipped_scenario("pfc_comau_6r")
    gains = scenario.controller.gains["singular_perturbation"]
    gains.phi = GainParameters(free=True, poles=[-10.0])
    assert warnings(scenario) == []


def test_only_what_leads_along_may_be_free():
    for key in ("xi", "posture"):
        with pytest.raises(InputError, match=f"{key}.free = True; allowed: false"):
            LawGains(**{key: GainParameters(free=True, coefficients=[3.0])})
