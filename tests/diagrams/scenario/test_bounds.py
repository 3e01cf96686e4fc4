"""Numbers far from all that a person would set are refused, with the unit."""

import numpy as np
import pytest

from diagrams.scenario import Scenario
from experiments.scenario_file import read_scenario
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed

SPHERE = "surface.shape=!Sphere"


@pytest.mark.parametrize(
    ("name", "change", "parts"),
    [
        ("sfc_polish", "model_error.random.joint_offset_deg=1e300", ["0 to 30 deg"]),
        ("sfc_polish", "model_error.random.joint_offset_deg=1e6", ["0 to 30 deg"]),
        ("sfc_polish", "model_error.random.center=2", ["0 to 1 m"]),
        ("sfc_polish", "model_error.random.mass=5.6", ["0 to 1 as a fraction"]),
        ("sfc_polish", "model_error.tool_mass=1e6", ["at most 1000 kg"]),
        ("vf_moving_region", "fixtures.regions.3.shape.radius=1e300", ["radius = 1e+300", "m"]),
        ("vf_moving_region", "fixtures.regions.1.shape.origin.0=1e300", ["origin", "10000 m"]),
        ("vf_forbidden_region", "fixtures.regions.3.shape.coefficient=1e300", ["10000 1/m"]),
        ("plate_mounting", "plate.mass=1e300", ["mass = 1e+300", "0.001 to 100 kg"]),
        ("plate_mounting", "plate.mass=500", ["mass = 500", "0.001 to 100 kg"]),
        ("plate_mounting", "plate.believed_mass=500", ["0 to 100 kg"]),
        ("vf_soft_circle", "compliance.tangential.mass.value=1e-300", ["0.001 to 10000 kg"]),
        ("vf_soft_circle", "compliance.transversal.mass.value=1e300", ["transversal.mass", "kg"]),
        ("vf_soft_circle", "compliance.rotational.mass.value=1e300", ["kg m^2"]),
        ("vf_soft_circle", "compliance.transversal.damping.value=1e300", ["N s/m"]),
        (
            "vf_soft_circle",
            "compliance.transversal.stiffness={over: xi, at: [0, 0.01], values: [2e3, 1e300]}",
            ["transversal.stiffness = 1e+300", "N/m, or .inf"],
        ),
        ("plate_mounting", "compliance.tangential.damping=!SlowEnds {most: 1e300}", ["N s/m"]),
        ("sfc_polish", "workpiece.ball.modulus=4", ["modulus = 4", "Pa; 4 MPa are 4e+06"]),
        ("sfc_polish", "controller.external_torque.bandwidth=1e300", ["0.01 to 100000 rad/s"]),
        # what was said in radians, or of another name
        (
            "sfc_polish",
            f"{SPHERE} {{latitudes_deg: [-30, 90]}}",
            ["latitudes_deg = [-30.0, 90.0]", "between -90 and 90 deg", "turn axis"],
        ),
        ("sfc_polish", "surface.shape=!Cone {opening_deg: 90}", ["opening_deg", "below 90 deg"]),
        ("sfc_polish", "surface.shape=!Cone {distances: [0, 1]}", ["apex"]),
        ("sfc_polish", "surface.shape=!Torus {ring_radius: 0.1}", ["more than tube_radius = 0.1"]),
    ],
)
def test_one_line_names_the_bound_and_its_unit(name, change, parts):
    with pytest.raises(InputError) as refused:
        load_typed(Scenario, read_scenario(name, [change]).data, name)
    said = str(refused.value)
    assert "\n" not in said
    assert all(part in said for part in parts), said
    assert "rad;" not in said


@pytest.mark.parametrize("axis", [[1, 0, 0], [-3, 0, 0], [0, 1, 0], [0, 0, -1], [1, 1, 0]])
def test_a_plane_stands_however_its_normal_points(axis):
    change = f"surface.shape=!Plane {{axis: {axis}}}"
    settings = load_typed(Scenario, read_scenario("sfc_polish", [change]).data, "x")
    rotation = settings.surface.shape.rotation
    np.testing.assert_allclose(rotation[:, 2], axis / np.linalg.norm(axis), atol=1e-15)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-15)
    # the first axis leans to x_0 where it can, else to y_0
    assert rotation[1 if axis[1] == axis[2] == 0 else 0, 0] > 0.5


def test_a_start_along_the_axis_is_still_refused():
    change = "surface.shape=!Plane {axis: [1, 0, 0], start: [1, 0, 0]}"
    settings = load_typed(Scenario, read_scenario("sfc_polish", [change]).data, "x")
    with pytest.raises(InputError, match="not along"):
        _ = settings.surface.shape.rotation
