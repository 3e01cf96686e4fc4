"""The DELTA robot's parameter file and what it refuses."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_parameters import DeltaParameters, load_delta_parameters
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.yaml.reading import read_yaml
from pfsc_drake.yaml.typed import load_typed

FILE = models_directory() / "festo_expt_45" / "parameters.yaml"


def test_the_shipped_robot_is_that_of_table_2_2():
    robot = load_delta_parameters()
    geometry, masses = robot.geometry, robot.masses
    assert [geometry.l_BC, geometry.l_A, geometry.l_EC, geometry.h_P] == [0.5, 0.416, 0.06, 0.325]
    assert [masses.slide, masses.plate, masses.rod_pair, masses.load] == [1.0, 1.0, 0.15, 0.7]
    assert masses.effective_slide == pytest.approx(1.1)
    assert masses.effective_plate == pytest.approx(1.85)
    # nothing of the rods is lost
    total = 3 * masses.effective_slide + masses.effective_plate
    assert total == pytest.approx(3 * 1.0 + 1.0 + 0.7 + 3 * 0.15)
    assert robot.gravity[2] > 0.0, "z_0 points down"
    assert np.all((robot.friction.coulomb >= 3.0) & (robot.friction.coulomb <= 8.0))
    assert np.all((robot.friction.viscous >= 5.0) & (robot.friction.viscous <= 20.0))


def test_rails_meet_at_P():
    geometry = load_delta_parameters().geometry
    ends = geometry.l_A * geometry.directions - geometry.rail_length * geometry.rails
    assert np.allclose(ends, [0.0, 0.0, geometry.h_P], rtol=0, atol=1e-15)
    assert np.allclose(np.linalg.norm(geometry.rails, axis=1), 1.0, rtol=0, atol=1e-15)


def test_a_file_is_loaded_by_its_path(tmp_path):
    copy = tmp_path / "own.yaml"
    copy.write_text(FILE.read_text().replace("load: 0.7", "load: 0.2"))
    assert load_delta_parameters(copy).masses.effective_plate == pytest.approx(1.35)


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("geometry", "l_BC"), -0.5, r"geometry.l_BC = -0.5; allowed: a positive number"),
        (("geometry", "l_EC"), 0.5, r"geometry.l_EC = 0.5; allowed: less than l_A = 0.416"),
        (("masses", "plate"), 0.0, r"masses\.plate = 0.0; allowed: a positive number"),
        (("masses", "load"), -1.0, r"masses\.load = -1.0; allowed: zero or a positive number"),
        (("gravity",), [0.0, 9.81], r"gravity = \[0.0, 9.81\]; allowed: 3 finite numbers"),
        (
            ("drives", "effort"),
            [200.0],
            r"drives\.effort = \[200.0\]; allowed: 3 positive",
        ),
        (("drives", "velocity"), [1.0, 0.0, 1.0], r"velocity = .*; allowed: 3 positive numbers"),
        (
            ("drives", "position_lower"),
            [-0.1, 0, 0],
            r"position_lower = .*; allowed: 3 .*, none neg",
        ),
        (("drives", "position_upper"), [0.4, 0.0, 0.4], r"position_lower = .*; allowed: less than"),
        (("drives", "position_upper"), [0.4, 0.53, 0.4], r"position_upper = .*P, 0.527902 m"),
        (
            ("friction",),
            {"coulomb": [5.0], "viscous": [9.0]},
            r"friction.coulomb = \[5.0\]; allowed: 3 finite numbers",
        ),
        (
            ("friction", "viscous"),
            [1.0, 2.0, -3.0],
            r"friction\.viscous = .*; allowed: .*, none neg",
        ),
        (
            ("workspace", "min_rod_independence"),
            1.0,
            r"min_rod_independence = 1.0; allowed: above 0",
        ),
    ],
)
def test_wrong_values_are_refused_in_one_line(keys, value, message):
    data = read_yaml(FILE)
    group = data
    for key in keys[:-1]:
        group = group[key]
    group[keys[-1]] = value
    with pytest.raises(InputError, match=message) as error:
        load_typed(DeltaParameters, data, "own.yaml")
    assert str(error.value).startswith("own.yaml")
    assert "\n" not in str(error.value)


def test_unknown_robots_are_refused():
    with pytest.raises(InputError, match=r"'expt_46': must be a file or one of festo_expt_45"):
        load_delta_parameters("expt_46")
