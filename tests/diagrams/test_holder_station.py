"""Two robots in one station: poses in Drake's plants, and faults that stop both."""

from copy import deepcopy

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain

from diagrams.builder import build_station
from diagrams.holder_station import HOLDER, PrefixingBuilder
from diagrams.robots.nominal_model import WORKPIECE
from diagrams.scenario import Scenario, SensorFailureParameters
from diagrams.scenario.robot import PoseParameters
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from tests.diagrams.station_run import run_station
from tests.scenarios import shipped_scenario

# s, when the seam is gone along; and from when on
END, BEGIN = 0.55, 0.3


def exact(**holder):
    """Return the scenario of two arms whose controllers know and see the truth."""
    settings, plain = shipped_scenario("pfc_two_arms"), Scenario()
    settings.reference.dwell = settings.holder.reference.dwell = 0.1
    for key in ("friction", "encoders", "model_error"):
        setattr(settings, key, getattr(plain, key))
        setattr(settings.holder, key, deepcopy(getattr(plain, key)))
    for key, value in holder.items():
        setattr(settings.holder, key, value)
    return settings


def run(settings, end=END, like=None):
    """Return a station, its context at the end, and its log."""
    return run_station(settings, end, like)


@pytest.fixture(scope="module")
def known():
    """Return the run of two arms that know the truth."""
    return run(exact())


def poses(station, root):
    """Return ``X_WC`` of the workpiece and ``X_WT`` of the tool, by Drake's two plants."""
    found = []
    for part, frame in ((station.holder.part, WORKPIECE), (station.part, "tool_point")):
        context = part.plant.GetMyContextFromRoot(root)
        found.append(part.plant.GetFrameByName(frame).CalcPoseInWorld(context))
    return found


def test_the_log_has_the_tool_in_the_workpiece_frame(known):
    station, root, log = known
    X_WC, X_WT = poses(station, root)
    X_CT = X_WC.inverse() @ X_WT
    assert log.time[-1] == pytest.approx(END)
    pose = log["y_t"].values[-1], log["R_e"].values[-1].reshape(3, 3)
    assert np.abs(pose[0] - X_CT.translation()).max() < 1e-12
    assert np.abs(pose[1] - X_CT.rotation().matrix()).max() < 1e-12
    pose = log["workpiece_pose"].values[-1]
    assert np.abs(pose[:3] - X_WC.translation()).max() < 1e-12
    assert np.abs(log["y_t_world"].values[-1] - X_WT.translation()).max() < 1e-12
    assert np.linalg.norm(X_WC.translation() - log["workpiece_pose"].values[0][:3]) > 0.01


def test_the_seam_is_followed_while_the_workpiece_moves(known):
    _, _, log = known
    moving = log.time >= BEGIN
    assert log["eta_dot"].values[moving].max() > 0.15
    turned = log["workpiece_pose"].values[-1, 3:].reshape(3, 3)
    begin = log["workpiece_pose"].values[0, 3:].reshape(3, 3)
    assert np.rad2deg(np.arccos(turned[:, 2] @ begin[:, 2])) > 5.0
    assert np.linalg.norm(log["xi"].values[moving], axis=1).max() < 1e-6
    assert np.linalg.norm(log["phi"].values[moving], axis=1).max() < 1e-5
    assert log["frame_error"].values.max() < 1e-12


def test_rates_are_those_of_the_true_coordinates(known):
    """They are computed from the actual motion of the workpiece, not from the nominal one."""
    _, _, log = known
    rate = np.gradient(log["eta"].values[:, 0], log.time)
    assert np.abs(rate - log["eta_dot"].values[:, 0])[5:-5].max() < 2e-5


def test_the_demand_on_the_drives_is_predicted(known):
    """Of both robots: torques and speeds of the plan are those of Drake's plants."""
    station, _, log = known
    for robot, prefix in ((station.controlled, ""), (station.holder.robot, HOLDER)):
        plan, last = robot.task.drive_plan, robot.controller.robot.dimension - 1
        assert not plan.messages
        at = np.flatnonzero((plan.times >= BEGIN) & (plan.times <= END))
        ticks = np.rint(plan.times[at] / 1e-3).astype(int)
        torque, speed = np.hsplit(plan.demand[at], 2)
        true = log[f"{prefix}tau_d"].values[ticks]
        # the torch may turn about its axis as it likes
        off = np.abs(torque - true)[:, :last]
        assert np.all(off < 0.02 * np.abs(true).max(axis=0)[:last] + 0.05)
        assert np.abs(speed - log[f"{prefix}v_M"].values[ticks])[:, :last].max() < 0.02


@pytest.mark.slow
def test_two_robots_that_are_too_fast_are_warned_of():
    """With a pace of both at which they are not."""

    def built(pace):
        settings = exact()
        for own in (settings, settings.holder):
            own.reference.limits = "warn"
            own.reference.velocity *= pace
            own.reference.acceleration *= pace**2
        return build_station(settings, SCENARIO_DIRECTORY)

    station = built(3.0)
    (said,) = station.task.drive_plan.messages
    assert said.startswith("the requested motion needs 94 % of the torque of axis 2 at eta = 0.45")
    assert said in station.warnings and not station.task.drive_plan.is_slowed
    pace = float(said.split("it fits with ")[1].split()[0])
    assert f"{pace**2:.2f} of the accelerations of both robots" in said
    assert not built(3.0 * pace - 0.03).task.drive_plan.messages


@pytest.mark.slow
def test_an_error_of_placement_becomes_an_error_of_the_tool(known):
    """No controller knows of it: as measured the tool is on the seam, and in truth beside it."""
    error = PoseParameters(position=[0.1e-3, 0.2e-3, -0.1e-3], zyx_deg=[0.0, 0.02, 0.0])
    station, root, log = run(exact(placement_error=error), like=known[0])
    seen = np.linalg.norm(log["xi_measured"].values[-1])
    assert seen < 1e-6
    X_WB = station.holder.parameters.robot.base_pose.transform()
    X_WC, X_WT = poses(station, root)
    X_WC_nominal = X_WB @ error.transform() @ X_WB.inverse() @ X_WC
    off = (X_WC.inverse() @ X_WT).translation() - (X_WC_nominal.inverse() @ X_WT).translation()
    tangent = np.diff(log["y_t"].values[-2:], axis=0)[0]
    tangent /= np.linalg.norm(tangent)
    across = np.linalg.norm(off - (off @ tangent) * tangent)
    assert across > 0.1e-3
    assert np.linalg.norm(log["xi"].values[-1]) == pytest.approx(across, rel=0.01)


@pytest.mark.slow
def test_missing_derivatives_cost_accuracy(known):
    deviation = {
        highest: np.linalg.norm(
            run(exact(highest=highest), like=known[0])[2]["xi"].values, axis=1
        ).max()
        for highest in (0, 2)
    }
    assert deviation[2] > 2e-7
    assert deviation[0] > 50.0 * deviation[2]


@pytest.mark.slow
def test_planned_derivatives_are_those_of_the_pose(known):
    """They equal differences of the actual poses, for a workpiece robot without errors."""
    station, root, log = run(exact(derivatives="planned"), like=known[0])
    moving = log.time >= BEGIN
    assert np.linalg.norm(log["xi"].values[moving], axis=1).max() < 1e-6
    _, raw = station.log.read(root)
    jet, pose = raw["holder_frame_jet"], log["workpiece_pose"].values
    middle = np.flatnonzero(moving)[1:-1]
    slope = (pose[middle + 1] - pose[middle - 1]) / 2e-3
    bend = (pose[middle + 1] - 2.0 * pose[middle] + pose[middle - 1]) / 1e-6
    assert np.abs(jet[middle, 12:24] - slope).max() < 1e-4 * np.abs(slope).max()
    assert np.abs(jet[middle, 24:36] - bend).max() < 3e-3 * np.abs(bend).max()


@pytest.mark.slow(but="holder")
@pytest.mark.parametrize("failing", ["follower", "holder"])
def test_a_fault_of_one_stops_both(known, failing):
    """The other one at the same tick or the next; both come to rest."""
    settings, failure = exact(), SensorFailureParameters(time=0.4, component=2)
    if failing == "holder":
        settings.holder.sensor_failure = failure
    else:
        settings.simulation.sensor_failure = failure
    station, root, log = run(settings, end=0.8, like=known[0])
    names = ["fault", f"{HOLDER}fault"]
    first, second = names if failing == "follower" else names[::-1]
    initial_conditions = [
        int(np.flatnonzero(log[name].values[:, 0])[0]) for name in (first, second)
    ]
    assert initial_conditions[1] - initial_conditions[0] == (1 if failing == "follower" else 0)
    assert log[first].values[-1, 0] == Fault.INPUT_NOT_FINITE
    assert log[second].values[-1, 0] == Fault.STOP_REQUESTED
    for name in ("v_J", f"{HOLDER}v_J"):
        assert np.abs(log[name].values[-1]).max() < 0.05
    said = station.fault(root)
    assert said.startswith("the robot that holds the workpiece: ") == (failing == "holder")
    assert "a measured value is not a finite number: q_J_3" in said


WRONG = {
    "holder.controller.law = rigid": lambda s: setattr(s.holder.controller, "law", "rigid"),
    "holder.controller.sampling_time = 0.002": lambda s: setattr(
        s.holder.controller, "sampling_time", 2e-3
    ),
    "holder.robot.tool_frame: the model": lambda s: setattr(s.holder.robot, "tool_frame", "grip"),
    "holder.robot.model = festo_expt_45": lambda s: setattr(
        s.holder.robot, "model", "festo_expt_45"
    ),
    "holder.workpiece.solids = 0 given, 0 kg": lambda s: s.holder.workpiece.solids.clear(),
    "holder.workpiece.solids[0].cylinder = []": lambda s: s.holder.workpiece.solids[
        0
    ].cylinder.clear(),
    "holder.start: tool point": lambda s: setattr(s.holder.path.shape, "center", [5.0, 0.0, 1.0]),
    "driver = given": lambda s: setattr(s.driver, "delay", 1e-3),
    "controller.manifold = space": lambda s: setattr(s.controller, "manifold", "space"),
}


@pytest.mark.slow(
    but=[
        "holder.robot.tool_frame: the model",
        "holder.start: tool point",
        "holder.workpiece.solids[0].cylinder = []",
        "driver = given",
        "controller.manifold = space",
    ]
)
@pytest.mark.parametrize("said", WRONG)
def test_wrong_input_is_refused_by_its_key(said):
    settings = exact()
    WRONG[said](settings)
    with pytest.raises(InputError) as error:
        build_station(settings, SCENARIO_DIRECTORY)
    assert str(error.value).startswith(said)
    assert "\n" not in str(error.value)


def test_where_there_are_no_two_robots(known):
    for further in ({"remote": True}, {"with_slope": True}):
        with pytest.raises(InputError, match="holder = given; allowed: null for margins"):
            build_station(exact(), SCENARIO_DIRECTORY, like=known[0], **further)


def test_names_begin_with_the_prefix_and_ports_are_connected():
    builder = DiagramBuilder()
    named = PrefixingBuilder(builder, "other_")
    builder.AddNamedSystem("source", ConstantVectorSource([1.0]))
    source = named.AddNamedSystem("source", ConstantVectorSource([2.0]))
    gain = named.AddNamedSystem("gain", Gain(3.0, 1))
    named.Connect(source.get_output_port(), gain.get_input_port())
    diagram = builder.Build()
    names = [system.get_name() for system in diagram.GetSystems()]
    assert names == ["source", "other_source", "other_gain"]
    context = gain.GetMyContextFromRoot(diagram.CreateDefaultContext())
    assert np.array_equal(gain.get_output_port().Eval(context), [6.0])
