"""A workpiece under a surface: pose, contact geometry, refusals."""

import dataclasses

import numpy as np
import pytest
from pydrake.geometry import HydroelasticContactRepresentation

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.scenario_file import SCENARIO_DIRECTORY, load_scenario_data
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.yaml.typed import load_typed

FILE = SCENARIO_DIRECTORY / "sfc_polish.yaml"
SHIFT, TURN = np.array([0.001, -0.002, 0.002]), [3.0, 1.0, -2.0]
MOVED = (f"workpiece.shift={SHIFT.tolist()}", f"workpiece.turn_zyx_deg={TURN}")


def load(*changes):
    return load_typed(Scenario, load_scenario_data(FILE, list(changes)), str(FILE))


@pytest.fixture(name="station", scope="module")
def fixture_station():
    return build_station(load(*MOVED, "encoders={}", "model_error={}"), SCENARIO_DIRECTORY)


def test_the_workpiece_is_the_surface_where_it_stands(station):
    vertices, triangles = station.workpiece.mesh()
    middle = np.array([0.75, 0.0, 0.6])  # of the domain
    back = (vertices - middle - SHIFT) @ zyx_to_matrix(np.deg2rad(TURN))
    np.testing.assert_allclose(back[:, 2], -(back[:, 0] ** 2 + back[:, 1] ** 2), atol=1e-12)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    assert np.cross(b - a, c - a)[:, 2].min() > 0.0  # material below the dome


def test_its_normal_turns_with_it(station):
    normal = station.workpiece.normal(np.eye(3))
    np.testing.assert_allclose(normal, zyx_to_matrix(np.deg2rad(TURN))[:, 2])


def contacts(station, depth):
    """Return how many surfaces touch, the tool point being so deep in the workpiece [m]."""
    start = station.task.start(np.zeros(3))
    normal = station.workpiece.normal(
        station.task.projected_manifold.axes(station.task.point(start)).full()
    )
    vertices, _ = station.workpiece.mesh()
    foot = vertices[np.argmin(np.linalg.norm(vertices - start.target.y_t, axis=1))]
    target = dataclasses.replace(start.target, y_t=foot - depth * normal)
    q_J = station.part.posture(target, load().start)
    root = station.diagram.CreateDefaultContext()
    station.set_robot_state(root, station.part.state_at_rest(q_J))
    plant = station.part.plant
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(root))
    triangles = HydroelasticContactRepresentation.kTriangle
    return len(query.ComputeContactSurfaces(triangles))


def test_the_ball_touches_where_the_tool_point_is_on_the_workpiece(station):
    # the ball is round and the mesh is flat between its vertices, by micrometres
    assert contacts(station, -5e-5) == 0
    assert contacts(station, 5e-5) == 1


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("workpiece.shift=[0, 0]", ["workpiece.shift", "3 finite numbers"]),
        ("workpiece.turn_zyx_deg=[0, 60, 0]", ["turn_zyx_deg", "45"]),
        ("workpiece.time_step=7e-4", ["workpiece.time_step", "whole fraction"]),
        ("workpiece.spacing=0", ["workpiece.spacing"]),
        ("start.offset=[0.001, 0]", ["start", "mm inside of the workpiece", "start.offset[0]"]),
        pytest.param(
            "start.offset=[-0.01, 0]",
            ["start", "mm inside of the workpiece"],
            marks=pytest.mark.slow,
        ),
        ("notch={}", ["notch", "null where there is a workpiece"]),
        ("surface.orientation={kind: given}", ["surface.orientation.kind", "normal"]),
        ("compliance.transversal.stiffness.value=100", ["press", "stiffness.value is 0"]),
        ("compliance.press.touching=11", ["touching = 11", "approach = 10"]),
        pytest.param(
            "compliance.transversal.damping.value=0",
            ["transversal.damping = 0", "positive"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_refused(change, parts):
    with pytest.raises(InputError) as caught:
        build_station(load(change), SCENARIO_DIRECTORY)
    for part in parts:
        assert part in str(caught.value)


def test_what_a_start_is_inside_of_is_the_workpiece_where_it_stands(station):
    vertices, _ = station.workpiece.mesh()
    vertex, normal = vertices[len(vertices) // 3], station.workpiece.normal(np.eye(3))
    station.workpiece.check_start(vertex + 1e-5 * normal)
    with pytest.raises(InputError, match="inside of the workpiece"):
        station.workpiece.check_start(vertex - 1e-5 * normal)
