"""A station's linear loop against its own simulation, and the loop at rest against both."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.scenario import Scenario
from experiments.scenario_file import read_scenario
from experiments.studies.margins.box import Error, smooth, without_error
from experiments.studies.margins.loop import StationLoop, linearize
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.margins import BrokenLoop, delay_margin, disc_margins, modes, with_delay
from pfsc_drake.yaml.typed import load_typed

# ticks at rest, after which the law extrapolates
SETTLED = 5


def settings_of(name, *overrides):
    data = read_scenario(name, list(overrides)).data
    return without_error(smooth(load_typed(Scenario, data, name))[0])


def at_rest(loop):
    simulator = Simulator(loop.station.diagram)
    loop.configure(simulator)
    root = simulator.get_mutable_context()
    loop.station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(SETTLED * loop.map.period)
    simulator.AdvancePendingEvents()
    return root


def folder():
    return Path(read_scenario("pfc_elastic_3r", []).path).parent


@pytest.fixture(name="three", scope="module")
def fixture_three():
    loop = StationLoop(settings_of("pfc_elastic_3r", "reference.dwell=2"), folder())
    section = at_rest(loop)
    chosen = loop.variables_in_loop([section])
    return loop, section, linearize(loop, section, chosen)


@pytest.mark.slow
def test_a_fast_joint_is_no_fault():
    """In one tick it moves by more than positions and velocities may contradict each other."""
    changes = ["reference={points: [0.96, 0.7], velocity: 1.5, acceleration: 8, dwell: 0.02}"]
    tolerance = 3e-4
    changes += [f"faults.plausibility={tolerance}", "start.transition=0.01"]
    loop = StationLoop(settings_of("pfc_elastic_3r", *changes), folder())
    simulator = Simulator(loop.station.diagram)
    loop.configure(simulator)
    root = simulator.get_mutable_context()
    loop.station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(0.15)
    assert not loop.has_failed(root)
    simulator.AdvancePendingEvents()
    plant = loop.station.part.plant
    v = plant.GetVelocities(plant.GetMyContextFromRoot(root))
    assert np.abs(v).max() * loop.map.period > 2.0 * tolerance
    assert linearize(loop, root, loop.variables_in_loop([root])) is not None


@pytest.mark.slow
@pytest.mark.parametrize("task", ["reference", "limits", "conditioning"])
def test_a_posture_that_is_pulled_is_in_the_loop(task):
    """What pulls it depends on the joints, and they follow it; a spring to a goal knows neither."""
    changes = [f"controller.posture.task={task}", "reference.dwell=1"]
    loop = StationLoop(settings_of("pfc_panda_7r", *changes), folder())
    chosen = loop.variables_in_loop([at_rest(loop)])
    states = loop.derivative.states
    rows = [states[name] for name in states if name.startswith("controller.posture_reference.")]
    own = np.isin(np.concatenate(rows), chosen)
    # the motion of seven joints, orders 0 to 2, not the goal
    assert own.sum() == (0 if task == "reference" else 21)


def differences(loop, section, chosen):
    """Derivative of the whole station's map, the controller included, by differences."""
    x, columns = loop.map.variables(section), []
    for variable in chosen:
        shift = np.zeros(loop.map.size)
        # a torque moves a joint by little within a tick
        step = 1e-2 if variable in loop.drives else 1e-5
        shift[variable] = step * max(1.0, abs(x[variable]))
        sides = [loop.map.advance(section, x + side)[chosen] for side in (shift, -shift)]
        columns.append((sides[0] - sides[1]) / (2.0 * shift[variable]))
    return np.column_stack(columns)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("pfc_elastic_3r", []),
        ("pfc_delta", []),
        (
            "pfc_elastic_3r",
            ["driver={delay: 0.002, low_pass: 100}", "controller.delay=0.002"],
        ),
        (
            "pfc_elastic_3r",
            ["encoders.sides=motor_and_torque", "controller.state=from_torque"],
        ),
    ],
)
def test_the_derivative_is_that_of_the_whole_station_in_motion(name, overrides):
    loop = StationLoop(settings_of(name, *overrides), folder())
    simulator = Simulator(loop.station.diagram)
    loop.configure(simulator)
    root = simulator.get_mutable_context()
    loop.station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(0.4)
    simulator.AdvancePendingEvents()
    chosen = loop.variables_in_loop([root])
    assert len(chosen) > len(loop.map.rows(loop.station.part.plant))
    A, expected = linearize(loop, root, chosen).A, differences(loop, root, chosen)
    scale = np.abs(expected).max(axis=0) + 1e-3
    np.testing.assert_allclose(A / scale, expected / scale, atol=2e-5)
    found, rates = modes(A, loop.map.period).rate, modes(expected, loop.map.period).rate
    slow = rates > -400.0
    # poles that are close together part at the least difference: compare what they are together
    np.testing.assert_allclose(found[: slow.sum()], rates[slow], rtol=5e-3, atol=1e-3)
    assert np.mean(found[: slow.sum()]) == pytest.approx(np.mean(rates[slow]), rel=1e-3)


CASES = [
    ("pfc_elastic_3r", []),
    ("pfc_elastic_3r", ["controller.law=rigid"]),
    ("pfc_elastic_3r", ["controller.law=singular_perturbation"]),
    ("pfc_viscoelastic_3r", []),
    # bodies get their drives' forces a step late
    ("pfc_delta", ["encoders.difference_quotient=false", "robot.plant=analytic"]),
    ("pfc_elastic_3r", ["driver.delay=0.002", "controller.delay=0.002"]),
    ("pfc_elastic_3r", ["driver.delay=0.003", "controller.delay=0.003", "controller.law=rigid"]),
]


@pytest.mark.slow(but="pfc_elastic_3r-overrides6")
@pytest.mark.parametrize(("name", "overrides"), CASES)
def test_the_loop_at_rest_is_that_of_the_whole_station(name, overrides):
    """Two ways that share the law's own function only, with masses believed too low."""
    factor, settings = 0.9, settings_of(name, *overrides)
    wrong = Error((("mass", factor - 1.0),)).applied_to(settings)
    loop = StationLoop(wrong, folder())
    section = at_rest(loop)
    linear = linearize(loop, section, loop.variables_in_loop([section]))
    station, period = loop.station, loop.map.period
    rest = RestPosture(station.start_posture, station.task.point(station.task.start(np.zeros(3))))
    robot, ticks = station.part.nominal_model.robot, wrong.driver.ticks(period)
    at_start = LoopAtRest(robot, station.law.linearization, rest, period, ticks=ticks)
    expected = modes(linear.A, period)
    found = modes(at_start.closed_loop(station.law.gains, mass=1.0 / factor), period)
    slow = np.sum(expected.rate > -400.0)
    assert slow >= 6
    # poles that are close together part at the least difference: compare what they are together
    np.testing.assert_allclose(np.mean(found.rate[:slow]), np.mean(expected.rate[:slow]), rtol=0.02)
    assert found.slowest == pytest.approx(expected.slowest, rel=0.08, abs=0.2)


def simulated(three, ticks, between):
    """Distance from rest while something happens to the drives' commands after every tick."""
    loop, section, _ = three
    rest = loop.map.variables(section)
    x, distance = rest.copy(), []
    x[0] += 1e-5
    context = section.Clone()
    for _ in range(ticks):
        x = loop.map.advance(context, x)
        context.SetTime(loop.map.context.get_time())
        x[loop.drives] = rest[loop.drives] + between(x[loop.drives] - rest[loop.drives])
        distance.append(np.linalg.norm((x - rest)[loop.map.rows(loop.station.part.plant)]))
    return np.array(distance)


def test_the_station_moves_like_its_linear_loop(three):
    loop, section, linear = three
    chosen = loop.variables_in_loop([section])
    rest, x = loop.map.variables(section), np.zeros(len(chosen))
    plant = np.isin(chosen, loop.map.rows(loop.station.part.plant))
    x[np.flatnonzero(plant)[0]] = 1e-5
    expected = []
    for _ in range(60):
        x = linear.A @ x
        expected.append(np.linalg.norm(x[plant]))
    found = simulated(three, 60, lambda told: told)
    assert rest.shape == (loop.map.size,)
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=1e-7)


@pytest.mark.slow
def test_the_delay_margin_is_what_the_station_bears(three):
    loop, _, linear = three
    period = loop.map.period
    margin = delay_margin(linear.A, linear.holds, period)
    for extra in (0, 1):
        waiting = [np.zeros(3)] * (margin + extra)

        def later(told, waiting=waiting):
            waiting.append(told)
            return waiting.pop(0)

        distance = simulated(three, 500, later)
        rate = modes(with_delay(linear.A, linear.holds, margin + extra), period).slowest
        assert (rate > 0.0) == bool(extra)
        late, early = distance[-100:].max(), distance[-300:-200].max()
        assert (late > early) == bool(extra)


@pytest.mark.slow
def test_gains_within_the_disc_margin_are_borne_and_others_need_not_be(three):
    loop, _, linear = three
    margins = disc_margins(BrokenLoop(linear.A, linear.holds, loop.map.period))
    drive = int(np.argmin([margin.alpha for margin in margins]))
    for factor in (0.98 * margins[drive].gain[1], 1.02 * margins[drive].gain[0]):
        scale = np.ones(3)
        scale[drive] = factor
        distance = simulated(three, 400, lambda told, scale=scale: scale * told)
        assert distance[-50:].max() < 0.2 * distance[:50].max()

    # the loop with a gain of its own, from its eigenvalues
    def slowest(factor):
        A = linear.A.copy()
        A[:, linear.holds[drive]] *= factor
        return modes(A, loop.map.period).slowest

    critical = next(f for f in np.geomspace(margins[drive].gain[1], 100.0, 200) if slowest(f) > 30)
    scale = np.ones(3)
    scale[drive] = critical
    distance = simulated(three, 200, lambda told: scale * told)
    assert distance[-20:].max() > 5.0 * distance[20:40].max()
