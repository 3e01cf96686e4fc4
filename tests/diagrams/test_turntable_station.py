"""A robot and a turntable in one station."""

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.robot_station import build_robot_station
from diagrams.scenario import Scenario
from diagrams.scenario.schema import driven
from diagrams.scenario.turntable import TurntableAxisParameters, TurntableParameters
from diagrams.turntable_station import turntable_command
from experiments.results.holder_feature import holder_metrics
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.errors import InputError
from tests.diagrams.station_run import run_station
from tests.scenarios import shipped_scenario

END, BEGIN = 0.6, 0.3  # s


def exact(**table):
    """Return the scenario with a robot that knows and sees the truth, and a table like that."""
    settings, plain = shipped_scenario("pfc_turntable"), Scenario()
    settings.reference.dwell = settings.turntable.dwell = 0.1
    for key in ("friction", "encoders", "model_error"):
        setattr(settings, key, getattr(plain, key))
    for key, value in ({"increments": 0.0, "lag": 0.0} | table).items():
        setattr(settings.turntable, key, value)
    return settings


def run(settings, like=None):
    """Return a station, its context at the end, and its log."""
    return run_station(settings, END, like)


@pytest.fixture(scope="module")
def late():
    """Return the run of a table that tells its angles 4 ms late, which is known."""
    return run(exact())


def off(log):
    return np.linalg.norm(log["xi"].values[log.time >= BEGIN], axis=1).max()


def test_the_seam_is_followed_while_the_table_turns(late):
    station, root, log = late
    assert log["turntable_rates"].values[-1, 1] < -1.0
    assert off(log) < 5e-8
    assert log["frame_error"].values.max() < 1e-8
    context = station.part.plant.GetMyContextFromRoot(root)
    X_WT = station.part.plant.GetFrameByName("tool_point").CalcPoseInWorld(context)
    assert np.abs(log["y_t_world"].values[-1] - X_WT.translation()).max() < 1e-12
    pose = log["workpiece_pose"].values[-1]
    seen = pose[3:].reshape(3, 3).T @ (X_WT.translation() - pose[:3])
    assert np.abs(log["y_t"].values[-1] - seen).max() < 1e-12


def test_the_demand_on_the_drives_includes_the_table(late):
    station, _, log = late
    plan = station.task.drive_plan
    at = np.flatnonzero((plan.times > BEGIN) & (plan.times < END))
    ticks = np.rint(plan.times[at] / 1e-3).astype(int)
    planned, true = plan.demand[at, :5], log["tau_d"].values[ticks, :5]
    assert np.all(np.abs(planned - true) < 0.03 * np.abs(true).max(axis=0) + 0.05)


@pytest.mark.slow(but="table0-0.0001")
@pytest.mark.parametrize(
    ("table", "least"), [({"nominal_delay": 0.0}, 0.1e-3), ({"derivatives": "none"}, 0.1e-3)]
)
def test_an_uncompensated_delay_costs_accuracy(late, table, least):
    _, _, log = run(exact(**table), like=late[0])
    assert off(log) > least


def test_metrics_are_those_of_a_workpiece_without_a_robot(late):
    found = holder_metrics(late[2], 0.0)
    assert found["peak_workpiece_turning"].value > 1.0
    assert "max_frame_error" in dict(found) and "max_workpiece_deviation" not in dict(found)


def test_axes_move_on_straight_lines_between_stops():
    axes = [TurntableAxisParameters(), TurntableAxisParameters()]
    stops = [[0.0, 0.0], [10.0, -40.0], [10.0, 20.0]]
    parameters = TurntableParameters(
        axes=axes, stops_deg=stops, velocity_deg=20.0, acceleration_deg=50.0, dwell=0.2
    )
    command = turntable_command(parameters)
    times = np.linspace(*command.domain, 2001)
    motion = np.rad2deg(command.derivatives(times, 2))
    ends = motion[0, 0], motion[-1, 0]
    assert np.allclose(ends, [stops[0], stops[-1]], rtol=0, atol=1e-9)
    first = motion[:, 0, 0] < 10.0 - 1e-9
    assert np.allclose(motion[first, 0, 1], -4.0 * motion[first, 0, 0], rtol=0, atol=1e-9)
    assert np.abs(motion[:, 1]).max() == pytest.approx(20.0, rel=1e-3)
    assert np.abs(motion[:, 2]).max() < 50.0 * (1.0 + 1e-9)
    assert min(np.abs(motion[:, 0] - stops[1]).sum(axis=1)) < 1e-6


def two_carriers(settings):
    settings.holder = shipped_scenario("pfc_two_arms").holder


WRONG = {
    "turntable.axes = 0 given": lambda s: s.turntable.axes.clear(),
    "turntable.stops_deg = []": lambda s: s.turntable.stops_deg.clear(),
    "turntable.stops_deg[1] = [0.0, 180.0]": lambda s: s.turntable.stops_deg.__setitem__(
        1, s.turntable.stops_deg[0]
    ),
    "turntable.stops_deg[0]": lambda s: s.turntable.stops_deg.__setitem__(0, [1.0]),
    "turntable.delay = 0.0035": lambda s: setattr(s.turntable, "delay", 0.0035),
    "turntable.nominal_delay = 1.0": lambda s: setattr(s.turntable, "nominal_delay", 1.0),
    "turntable = given": two_carriers,
    "driver = given; allowed: left out with a turntable": lambda s: setattr(
        s.driver, "delay", 1e-3
    ),
}


@pytest.mark.slow(
    but=[
        "turntable.axes = 0 given",
        "turntable.stops_deg[1] = [0.0, 180.0]",
        "turntable.delay = 0.0035",
        "turntable = given",
        "driver = given; allowed: left out with a turntable",
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


def test_margins_know_no_turntable(late):
    with pytest.raises(InputError, match="turntable = given; allowed: null for margins"):
        build_station(exact(), SCENARIO_DIRECTORY, like=late[0], with_slope=True)


@pytest.mark.parametrize("carrier", ["holder", "turntable"])
def test_a_robot_elsewhere_has_no_workpiece_that_moves(carrier):
    settings = shipped_scenario("pfc_two_arms" if carrier == "holder" else "pfc_turntable")
    with pytest.raises(InputError, match=f"^{carrier} = given; allowed: null where the robot"):
        driven(settings)
    with pytest.raises(InputError, match=f"^{carrier} = given; allowed: null where the contr"):
        build_robot_station(settings, SCENARIO_DIRECTORY)
