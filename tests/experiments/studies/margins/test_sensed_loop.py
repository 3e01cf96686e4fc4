"""The loop over a force sensor, and over a surface that is touched, against their simulation."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.scenario import Scenario
from experiments.scenario_file import read_scenario
from experiments.studies.margins.box import Error, smooth, without_error
from experiments.studies.margins.loop import StationLoop, linearize
from pfsc_drake.control.margins import Modes, modes
from pfsc_drake.yaml.typed import load_typed

LIGHT = ("sensor.inertia=none", "compliance.transversal.mass.value=2")
JOINT, FORCE = "", 20.0


def tared_loop(*overrides):
    """Return the loop of what presses, at rest above its workpiece, and that section."""
    source = read_scenario("sfc_polish", list(overrides))
    settings = without_error(smooth(load_typed(Scenario, source.data, "sfc_polish"))[0])
    loop = StationLoop(settings, Path(source.path).parent)
    simulator = Simulator(loop.station.diagram)
    loop.configure(simulator)
    root, period = simulator.get_mutable_context(), loop.map.period
    loop.station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(3 * period)
    simulator.AdvancePendingEvents()
    assert loop.needs_taring(root)
    loop.tare(root, np.zeros(6))
    assert not loop.needs_taring(root)
    np.testing.assert_allclose(loop.external_load(root), 0.0, atol=1e-6)
    simulator.AdvanceTo(8 * period)
    simulator.AdvancePendingEvents()
    return loop, root


@pytest.fixture(name="light", scope="module")
def fixture_light():
    return tared_loop(*LIGHT)


@pytest.fixture(name="shipped", scope="module")
def fixture_shipped():
    return tared_loop()


def with_payload(loop, section, mass):
    heavy = section.Clone()
    loop.hang(heavy, JOINT, mass)
    loop.tare(heavy, np.zeros(6))
    return heavy


def moved(loop, section, ticks):
    """Return how a small shift of the robot goes on, tick by tick, as if the section stayed.

    Each tick is that of the whole station, with all that it remembers; beside it goes the one
    without the shift.
    """
    middle, start = loop.map.advance(section), loop.map.variables(section)
    shift, found = np.zeros(loop.map.size), []
    shift[loop.map.rows(loop.station.part.plant)[:6]] = 1.0
    total = 0.0
    for _ in range(ticks):
        size = np.linalg.norm(shift)
        total += np.log(size)
        shifted = loop.map.advance(section, start + 1e-7 * shift / size)
        with np.errstate(invalid="ignore"):  # what has not happened yet is at infinity
            shift = np.nan_to_num((shifted - middle) / 1e-7)
        found.append(np.exp(total) * shift)
    return np.array(found)


def linear_modes(loop, section, differences) -> Modes:
    """Return the modes of what a shift of the robot changes."""
    reached = np.any(np.abs(differences) > 0.0, axis=0)
    reached[loop.map.rows(loop.station.part.plant)] = reached[loop.drives] = True
    linear = linearize(loop, section, np.flatnonzero(reached))
    assert linear is not None
    return modes(linear.A, loop.map.period)


@pytest.mark.slow
def test_a_heavy_payload_below_the_sensor_makes_a_light_admittance_chatter(light):
    """In the run the drives jump between their limits at 185 Hz."""
    loop, section = light
    heavy = with_payload(loop, section, 2.0)
    differences = moved(loop, heavy, 90)
    found = linear_modes(loop, heavy, differences)
    assert found.slowest_frequency / (2.0 * np.pi) == pytest.approx(185.0, rel=0.1)
    velocity = np.linalg.norm(differences[:, loop.map.rows(loop.station.part.plant)[6:]], axis=1)
    grown = np.log(velocity[70:].max() / velocity[40:60].max()) / (30 * loop.map.period)
    assert found.slowest == pytest.approx(grown, rel=0.15)
    assert found.slowest > 0.0


@pytest.mark.slow
def test_the_shipped_one_bears_three_kilograms_more(shipped):
    loop, section = shipped
    heavy = with_payload(loop, section, 3.0)
    differences = moved(loop, heavy, 60)
    assert linear_modes(loop, heavy, differences).is_stable
    plant = loop.map.rows(loop.station.part.plant)
    size = np.linalg.norm(differences[:, plant], axis=1)
    assert size[40:].max() < 0.5 * size[:20].max()


@pytest.mark.slow
def test_what_is_pressed_on_is_a_spring_that_may_be_stiffer_but_not_at_will(shipped):
    loop, section = shipped
    free = loop.pressed_force(section)
    pressed = loop.stiffened(section, loop.spring.stiffness)
    own = loop.spring.GetMyMutableContextFromRoot(pressed)
    loop.spring.set_stiffness(own, loop.spring.stiffness, FORCE)
    assert (free, loop.pressed_force(pressed)) == (0.0, pytest.approx(FORCE))
    stiff = loop.stiffened(pressed, 60.0 * loop.spring.stiffness)
    assert loop.pressed_force(stiff) == pytest.approx(FORCE)
    differences = moved(loop, stiff, 60)
    assert linear_modes(loop, pressed, differences).is_stable
    found = linear_modes(loop, stiff, differences)
    assert not found.is_stable


@pytest.mark.slow
def test_plant_and_spring_are_the_same_for_a_loop_that_errs(shipped):
    loop, section = shipped
    assert loop.rest_is_physics
    source = read_scenario("sfc_polish", [])
    settings = without_error(smooth(load_typed(Scenario, source.data, "sfc_polish"))[0])
    erring = Error((("mass", -0.05),)).applied_to(settings)
    other = StationLoop(erring, Path(source.path).parent, loop)
    sections = section.Clone(), other.map.adopted(section)
    for one, pressed in zip((loop, other), sections, strict=True):
        spring = one.spring.GetMyMutableContextFromRoot(pressed)
        one.spring.set_stiffness(spring, one.spring.stiffness, FORCE)
    chosen = loop.variables_in_loop([sections[0]])
    known = linearize(loop, sections[0], chosen)
    own = linearize(other, sections[1], chosen)
    reused = linearize(other, sections[1], chosen, known.rest)
    assert np.abs(own.A - known.A).max() > 1e-3
    np.testing.assert_allclose(reused.A, own.A, rtol=1e-9, atol=1e-9)
