"""Tasks whose coordinates are the tool's own Euler angles, near where these are singular."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario import SurfaceParameters
from diagrams.scenario.motion import StartParameters
from diagrams.scenario_task import make_task
from experiments.scenario_file import find_scenario
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.paths.path_warnings import euler_warnings
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters

PITCH = [-20.0, 30.0, 84.0, 10.0]


def near(pitch):
    """Return the warnings of orientations with these second ZYX angles."""
    R_d = zyx_to_matrix(np.deg2rad([[10.0, b, -20.0] for b in pitch]))
    return euler_warnings("zyx", R_d, "path", lambda i: f"at sample {i}")


def test_silence_far_from_it():
    assert near(PITCH[:2]) == []
    assert euler_warnings(None, zyx_to_matrix([[0.0, np.pi / 2.0, 0.0]]), "path", str) == []


def test_near_it_a_warning_says_where_and_what_to_write():
    (sentence,) = near(PITCH)
    said = "path.orientation.jacobian = analytic: the zyx angles of the reference are 6 deg from "
    assert sentence.startswith(f"{said}their singularity at sample 2; write ")
    assert "path.orientation.jacobian: geometric, or path.orientation.convention: zyz" in sentence


def test_at_it_there_is_no_law():
    with pytest.raises(InputError, match=r"are 0\.5 deg from their singularity at sample 1; write"):
        near([0.0, -89.5])


@pytest.mark.parametrize("manifold", ["path", "trajectory"])
def test_along_a_path(load_scenario, manifold):
    """ZYX angles stay 64 deg away from it, ZYZ angles pass it by 4.6 deg."""
    settings = load_scenario("pfc_compliant_6r")
    settings.controller.manifold = manifold
    settings.reference.hold_back = None
    folder, said = find_scenario("pfc_compliant_6r").parent, settings.path.orientation
    plain = make_task(settings, folder)
    assert plain.manifold.tool.euler is plain.projected_manifold.tool.euler is None
    said.jacobian = "analytic"
    task = make_task(settings, folder)
    assert task.manifold.tool.euler == task.projected_manifold.tool.euler == "zyx"
    assert task.warnings == plain.warnings
    said.convention = "zyz"
    (sentence,) = set(make_task(settings, folder).warnings) - set(plain.warnings)
    assert (
        "the zyz angles of the reference are 4.64 deg from their singularity at eta = " in sentence
    )


@pytest.mark.parametrize("kind", ["given", "normal"])
def test_where_a_surface_is_entered(load_scenario, kind):
    """A level plane, whose tool points straight up but for two degrees."""
    settings = load_scenario("sfc_elastic_6r")
    orientation = SurfaceOrientationParameters(kind, "zyz", [0.0, 2.0, 0.0], jacobian="analytic")
    settings.surface = SurfaceParameters(Plane(origin=[0.8, 0.0, 1.0]), orientation)
    settings.start = StartParameters()
    settings.reference.places = [[0.0, 0.0], [0.1, 0.0]]
    task = make_task(settings, Path())
    assert task.manifold.tool.euler == "zyz"
    assert "surface.orientation.jacobian = analytic: the zyz angles" in task.warnings[0]
    assert "2 deg from their singularity at the start" in task.warnings[0]
    orientation.angles_deg = [0.0, 0.2, 0.0]
    with pytest.raises(InputError, match=r"0\.2 deg from their singularity at the start"):
        make_task(settings, Path())


def test_in_space(load_scenario):
    settings = load_scenario("vf_wedge")
    said = settings.fixtures.orientation
    said.jacobian, folder = "analytic", find_scenario("vf_wedge").parent
    plain = make_task(settings, folder)
    assert plain.manifold.tool.euler == said.convention == "zyz"
    said.angles_deg = [10.0, 176.0, 0.0]
    (sentence,) = set(make_task(settings, folder).warnings) - set(plain.warnings)
    assert "fixtures.orientation.jacobian = analytic" in sentence
    assert "4 deg from their singularity everywhere" in sentence
