"""A process between two robots: wrenches on both plants, and deviations of the tool."""

import numpy as np
import pytest
from pydrake.multibody.math import SpatialForce

from diagrams.builder import build_station
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.errors import InputError
from pfsc_drake.physics.scripted_force import ForcePulse
from tests.diagrams.test_holder_station import exact, poses, run

END = 0.75
# N, along the world and along the seam, all there from 0.2 s on
WORLD, ALONG = [5.0, -10.0, 60.0], -20.0


def grinding(source, **holder):
    """Return two arms that know the truth but for the process, of which a source tells."""
    settings = exact(**holder)
    settings.forces = [
        ForcePulse(0.1, 2.0, force=WORLD, torque=[1.0, 0.5, -2.0], ramp=0.1),
        ForcePulse(0.1, 2.0, force=[ALONG, 0.0, 0.0], ramp=0.1, frame="manifold"),
    ]
    for controller in (settings.controller, settings.holder.controller):
        controller.external_torque.source = source
        controller.external_torque.bandwidth = 200.0
    return settings


@pytest.fixture(scope="module")
def known():
    """Return the run of two arms that receive the force of the process."""
    return run(grinding("known"))


def applied(part, root, about):
    """Return the sum of what acts on a plant's bodies, moments about a point of the world."""
    plant, total = part.plant, np.zeros(6)
    context = plant.GetMyContextFromRoot(root)
    for force in plant.get_applied_spatial_force_input_port().Eval(context):
        X_WB = plant.get_body(force.body_index).EvalPoseInWorld(context)
        point = X_WB @ force.p_BoBq_B
        total += force.F_Bq_W.Shift(about - point).get_coeffs()
    return total


@pytest.mark.slow
def test_opposite_wrenches_act_on_the_plants(known):
    """As sums over the bodies of both of Drake's plants, moments about a point of neither."""
    station, root, log = known
    about = np.array([0.3, -0.7, 0.2])
    first = applied(station.part, root, about)
    second = applied(station.holder.part, root, about)
    assert np.linalg.norm(first) > 60.0
    assert np.abs(first[3:] + second[3:]).max() < 1e-12
    # the lever is that of the tick before
    assert np.abs(first + second).max() < 0.05
    _, X_WT = poses(station, root)
    wrench = log["wrench_ext"].values[-1]
    acting = SpatialForce(tau=wrench[3:], f=wrench[:3])
    measured = acting.Shift(about - X_WT.translation()).get_coeffs()
    assert np.abs(measured - first).max() < 0.05


@pytest.mark.slow
def test_the_force_along_the_seam_is_one_of_the_seam_in_the_world(known):
    """Its direction is that of the seam where the workpiece has it, not that in its frame."""
    _, _, log = known
    part = log["wrench_ext"].values[-1, :3] - WORLD
    way = np.diff(log["y_t"].values[-3:], axis=0).sum(axis=0)
    R_WC = log["workpiece_pose"].values[-2, 3:].reshape(3, 3)
    tangent = R_WC @ way / np.linalg.norm(way)
    assert part @ tangent == pytest.approx(ALONG, rel=1e-4)
    assert np.linalg.norm(part) == pytest.approx(-ALONG, rel=1e-9)


@pytest.mark.slow
def test_with_known_forces_both_arms_stay_on_their_paths(known):
    _, _, log = known
    late = log.time >= 0.5
    for name in ("xi", "holder_xi"):
        assert np.linalg.norm(log[name].values[late], axis=1).max() < 2e-6


@pytest.mark.slow
@pytest.mark.parametrize("unmodelled", ["both", "holder"])
def test_with_unmodelled_forces_the_tool_leaves_the_seam(known, unmodelled):
    settings = grinding("known")
    settings.holder.controller.external_torque.source = "none"
    if unmodelled == "both":
        settings.controller.external_torque.source = "none"
    _, _, log = run(settings, like=known[0])
    off = {name: np.linalg.norm(log[name].values, axis=1).max() for name in ("xi", "holder_xi")}
    assert off["holder_xi"] > 0.2e-3
    assert off["xi"] > 0.1e-3


@pytest.mark.slow
def test_the_holder_receives_the_force_measured_by_the_other_robot(known):
    """At the workpiece's frame; it has no sensor of its own."""
    settings = grinding("measured")
    settings.sensor.noise = np.zeros(6)
    station, root, _ = run(settings, end=0.5, like=known[0])
    _, raw = station.log.read(root)
    measured, true = raw["holder_wrench_measured"][-1], raw["holder_wrench_ext"][-1]
    assert np.linalg.norm(true[:3]) > 60.0
    assert np.abs(measured - true).max() < 0.3
    assert not any("sensor" in line for line in station.holder.warnings())


@pytest.mark.slow
def test_what_does_not_know_of_the_process_is_warned_of(known):
    settings = grinding("none")
    station = build_station(settings, SCENARIO_DIRECTORY, like=known[0])
    said = [line for line in station.warnings if "forces act on the tool" in line]
    assert len(said) == 2
    assert sum(line.startswith("the robot that holds the workpiece") for line in said) == 1


def test_forces_on_links_are_refused():
    settings = exact()
    settings.forces = [ForcePulse(link="link_3")]
    with pytest.raises(InputError, match=r"^forces\[0\].link = 'link_3'; allowed: empty with a"):
        build_station(settings, SCENARIO_DIRECTORY)
