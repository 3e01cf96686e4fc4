"""What a session tells the page."""

import json
from types import SimpleNamespace

import numpy as np

from diagrams.station import Station
from experiments.live.status import LiveStatus, coordinate_labels
from pfsc_drake.control.fixtures.contact_program import SLOTS
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord
from pfsc_drake.control.fixtures.robot_limits import limit_kinds
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller.tasks.space_task import SpaceTask
from tests.control.conftest import Robot

COORDINATES = PathManifold(2, oriented=False).coordinates
STATION = SimpleNamespace(
    law=SimpleNamespace(
        linearization=SimpleNamespace(
            manifold=SimpleNamespace(coordinates=COORDINATES, name="path")
        ),
        layout=SimpleNamespace(manifold_state=slice(2, 8)),
    ),
    mode_labels=("free", "surface", "edge"),
)
STATION.mode_name = lambda mode: Station.mode_name(STATION, mode)
SIGNALS = {
    "law": np.array([9.0, 9.0, 0.4, 0.001, -0.002, 1.0, 1.0, 1.0]),
    "wrench_ext": np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
    "manifold_force": np.array([5.0, 6.0, 7.0]),
    "impedance": np.array([3.0, 3.0, 3.0, 90.0, 0.0, 150.0, 0.0, np.inf, 5000.0]),
    "tank": np.array([0.25]),
    "tared": np.array([0.0]),
    "mode": np.array([1.0]),
}


def test_it_says_where_the_tool_is_what_acts_and_what_yields():
    status = LiveStatus("mine", phase="running", factor=0.5)
    status.observe(STATION, SIGNALS)
    content = json.loads(json.dumps(status.content(), allow_nan=False))
    assert content["progress"] == {"eta": 0.4}
    assert content["deviation"] == {"xi_1": 0.001, "xi_2": -0.002}
    assert content["force"] == [1.0, 2.0, 3.0]
    assert content["measured"] == {"eta": 5.0, "xi_1": 6.0, "xi_2": 7.0}
    assert content["stiffness"] == {"eta": 0.0, "xi_1": None, "xi_2": 5000.0}
    assert content["damping"]["xi_2"] == 150.0
    assert content["tank"] == 0.25
    assert content["ready"] is False
    assert content["slow"] is True
    assert content["mode"] == "surface"
    assert content["labels"] == {
        "eta": "along (eta)",
        "xi_1": "across (xi_1)",
        "xi_2": "across (xi_2)",
    }


def test_in_space_it_tells_the_nearest_region_and_what_leads():
    record = GuidanceRecord(2)
    row = np.zeros(record.size)
    row[record.fields["force"]] = 4.0, 5.0, 6.0
    row[record.fields["damping"]] = 90.0
    slots = np.zeros((SLOTS, len(SLOT)))
    slots[:, 0] = -1.0
    slots[:2, :2] = [[1.0, 0.02], [0.0, -1e-4]]
    row[record.fields["near"]] = slots.ravel()
    axes = SpaceManifold(1).coordinates
    manifold = SimpleNamespace(coordinates=axes, name="space")
    law = SimpleNamespace(
        linearization=SimpleNamespace(manifold=manifold),
        layout=SimpleNamespace(manifold_state=slice(0, 3)),
    )
    station = SimpleNamespace(law=law, robot=SimpleNamespace(dimension=6))
    signals = {"law": np.zeros(3), "wrench_ext": np.zeros(6), "guidance": row}
    status = LiveStatus("mine")
    status.observe(station, signals)
    assert status.deviation == {"nearest region": -1e-4}
    assert status.labels == {"eta_1": "x", "eta_2": "y", "eta_3": "z"}
    assert status.measured == {"eta_1": 4.0, "eta_2": 5.0, "eta_3": 6.0}
    assert status.damping == {"eta_1": 90.0, "eta_2": 90.0, "eta_3": 90.0}
    slots[:, 0] = -1.0
    row[record.fields["near"]] = slots.ravel()
    status.observe(station, signals)
    assert status.deviation == {}


def test_among_several_paths_it_tells_the_one_that_pulls():
    task = object.__new__(SpaceTask)
    task.guides = {"circle_1": None, "line_2": None}
    station = SimpleNamespace(law=STATION.law, task=task)
    record = GuideRecord(2)
    row = np.zeros(record.size)
    row[record.fields["active"]], row[record.fields["distance"]] = 1.0, [0.03, 0.01]
    status = LiveStatus("mine")
    for active, told in ((1.0, {"line_2": 0.01}), (-1.0, {"xi_1": 0.001, "xi_2": -0.002})):
        row[record.fields["active"]] = active
        signals = {"law": SIGNALS["law"], "wrench_ext": np.zeros(6), "guides": row}
        status.observe(station, signals)
        assert status.deviation == told


def chain_at_its_end():
    """A station of a Comau whose elbow is nearly stretched."""
    chain = Robot("comau_racer_1_4").chain
    axes = SpaceManifold(1).coordinates
    law = SimpleNamespace(
        linearization=SimpleNamespace(manifold=SimpleNamespace(coordinates=axes, name="space")),
        layout=SimpleNamespace(manifold_state=slice(0, 3)),
    )
    tool = SimpleNamespace(tool_axis=None, yaw_axis=None)
    place = SimpleNamespace(is_oriented=True, tool=tool)
    part = SimpleNamespace(nominal_model=SimpleNamespace(robot=chain))
    task = SimpleNamespace(projected_manifold=place)
    station = SimpleNamespace(law=law, robot=chain, part=part, task=task)
    q = np.deg2rad([2.0, 60.0, 74.0, 5.0, 60.0, 3.0])
    return station, {"law": np.zeros(3), "wrench_ext": np.zeros(6), "joint_state": np.tile(q, 4)}


def test_it_names_what_of_the_robot_holds_the_hand():
    """The limit that holds most; it is no region that is near."""
    station, signals = chain_at_its_end()
    record, status = GuidanceRecord(2), LiveStatus("mine")
    index, phi = SLOT.index("index"), SLOT.index("phi")
    for (first, force), (second, other), expected in [
        ((2 + 4 * 2, 5.0), (2 + 4 * 4 + 3, 1.0), "axis 3 at its speed"),
        ((2 + 4 * 2, 5.0), (2 + 4 * 4 + 3, 9.0), "axis 5 near its end"),
        ((2 + 4 * 2, 0.0), (2 + 4 * 6, 3.0), "elbow nearly stretched or folded"),
        ((2 + 4 * 2, 0.0), (1, 9.0), None),
    ]:
        slots = np.zeros((SLOTS, len(SLOT)))
        slots[:, index] = -1.0
        slots[0, index], slots[0, phi] = 0.0, 20.0
        slots[0, SLOT.index("h")] = 1e-3
        slots[1, index], slots[1, phi] = first, force
        slots[2, index], slots[2, phi] = second, other
        slots[2, SLOT.index("h")] = 2e-3 if second < 2 else 0.0
        row = np.zeros(record.size)
        row[record.fields["near"]] = slots.ravel()
        status.observe(station, signals | {"guidance": row})
        assert status.limit == expected
        assert status.deviation == {"nearest region": 1e-3}


def test_along_a_path_it_names_the_limit_too():
    station, signals = chain_at_its_end()
    kinds = list(dict.fromkeys(limit_kinds(6)))
    status = LiveStatus("mine")
    for kind, text in [("end_2", "axis 2 near its end"), ("speed_1", "axis 1 at its speed")]:
        forces = np.array([2.0 * (name == kind) for name in kinds])
        status.observe(station, signals | {"limit_force": forces})
        assert status.limit == text
    status.observe(station, signals | {"limit_force": np.zeros(len(kinds))})
    assert status.limit is None


def test_without_modes_there_is_none_and_unknown_ones_are_numbers():
    status = LiveStatus("mine")
    status.observe(STATION, {name: SIGNALS[name] for name in ("law", "wrench_ext")})
    assert status.mode is None
    assert status.ready
    status.observe(STATION, SIGNALS | {"mode": np.array([7.0])})
    assert status.mode == "7"


def test_what_is_not_finite_is_null():
    status = LiveStatus("mine")
    status.observe(STATION, SIGNALS | {"wrench_ext": np.full(6, np.nan)})
    assert status.content()["force"] == [None] * 3


def test_rotations_have_their_axes_in_words():
    labels = coordinate_labels(SpaceManifold(1, (1.0, 0.0, 0.0, 0.0)))
    assert list(labels.values())[3:] == [f"rotation about {axis} (phi_{axis})" for axis in "zyx"]
    labels = coordinate_labels(PathManifold(2, oriented=True, yaw_axis=(0.0, 0.0, 1.0)))
    assert labels["phi"] == "rotation (phi)"
