"""Reading of parameters and appearance: the numbers derived from them, and wrong files."""

import re

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.models.robot_parameters import ArmParameters, load_parameters
from pfsc_drake.robot.models.visuals import Appearance
from pfsc_drake.yaml.typed import load_file

DIRECTORY = models_directory() / "comau_racer_1_4"


def test_comau_numbers_of_the_dissertation():
    comau = load_parameters("comau_racer_1_4")
    np.testing.assert_allclose(comau.denavit_hartenberg.table().alpha[0], np.pi / 2, rtol=1e-15)
    reflected = [4.9491, 4.9491, 2.178466, 0.1740686, 0.1668916, 0.05980684]
    np.testing.assert_allclose(comau.rotors.reflected_inertia, reflected, rtol=1e-6)
    limits = comau.joint_limits
    np.testing.assert_allclose(limits.position_lower[1], -1.134464, atol=1e-6)
    np.testing.assert_allclose(limits.velocity[5], 10.47198, atol=1e-5)
    np.testing.assert_allclose(limits.acceleration[2], 11.62389, atol=1e-5)
    expected = 1e4 * np.array([35, 35, 19, 3, 1, 0.5])  # 3.8.4
    np.testing.assert_array_equal(comau.elasticities["elastic_6r"].stiffness, expected)
    np.testing.assert_array_equal(comau.elasticities["elastic_3r"].stiffness, expected[:3] / 10)
    assert not np.any(comau.elasticities["elastic_3r"].damping)


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (r"mass: 37\.39042", "mass: heavy", r"'links\[1\]\.mass' is 'heavy': expected a number"),
        (
            r"mass: 37\.39042",
            "mass: -1.0",
            r"links\[1\]\.mass = -1\.0; allowed: a positive",
        ),
        (r"mass: 37\.39042", "mass: .inf", r"links\[1\]\.mass = inf; allowed: a positive number"),
        (r"mass: 37\.39042", "weight: 37", r"unknown key 'links\[1\]\.weight' = 37: allowed: name"),
        (r"d: \[0\.43, 0\.0, ", "d: [", r"denavit_hartenberg\.a = .*allowed: 4 finite numbers"),
        (r"d: \[0\.43.*\]", "d: []", r"denavit_hartenberg\.d = \[\]; allowed: one number per"),
        (
            r"stiffness: \[350",
            "stiffness: [-350",
            r"elastic_6r\.stiffness = .*allowed: positive",
        ),
        (
            r"damping: \[0",
            "damping: [-1",
            r"elastic_6r\.damping = .*allowed: .* none negative",
        ),
        (r"5\.375454, ", "0.375454, ", r"links\[1\]\.inertia = .*allowed: physical"),
        (r"tool_point: \[0\.0, ", "tool_point: [", r"tool\.tool_point = .*allowed: 3 finite"),
        (r"name: tool", "name: ''", r"tool\.name = ''; allowed: a name"),
        (r"  - name: link_1(.*\n){4}", "", r"links = 5; allowed: 6 links"),
        (
            r"coulomb: .*\n  viscous: .*\n",
            "coulomb: [1, 2]\n  viscous: [1, 2]\n",
            r"friction\.coulomb = \[1\.0, 2\.0\]; allowed: 6 finite numbers",
        ),
        (r"elasticity: elastic_6r", "elasticity: elastic_3r", r"variants\[1\]\.elasticity = "),
        (r"\[-165\.0", "[165.0", "position_lower_deg = .*less than position_upper_deg"),
        (r"body_mass: 1\.0e-5", "body_mass: 1.0", r"rotors\.body_mass = 1\.0; allowed:"),
        (r"body_mass: 1\.0e-5", "body_mass: -1", r"rotors\.body_mass = -1\.0; allowed: at"),
        (r"fixed_deg: \[\]", "fixed_deg: [0, 0, 0, 0, 0, 0]", r"fixed_deg = .*less than 6 angles"),
        (r"    mass: 37\.39042\n", "", r"missing key 'links\[1\]\.mass': expected a number"),
        (r"  gear_ratio: .*\n", "", r"missing key 'rotors\.gear_ratio': expected a list"),
        (r"\nfriction:(.*\n){4}", "\n", r"missing key 'friction'"),
        (r"name: comau_racer_1_4\n", "name: [\n", "invalid YAML in line"),
    ],
)
def test_wrong_parameters_name_file_and_key(tmp_path, pattern, replacement, message):
    text = (DIRECTORY / "parameters.yaml").read_text(encoding="utf-8")
    changed = re.sub(pattern, replacement, text, count=1)
    assert changed != text
    path = tmp_path / "robot.yaml"
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_parameters(path)
    assert re.match(rf"{re.escape(str(path))}(:\d+)?: ", str(caught.value))
    assert "\n" not in str(caught.value)


def test_parameters_are_ones_own_and_those_of_the_file_as_it_is(tmp_path):
    text = (DIRECTORY / "parameters.yaml").read_text(encoding="utf-8")
    path = tmp_path / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    mass = load_parameters(path).links[0].mass
    load_parameters(path).links[0].mass += 1.0
    assert load_parameters(path).links[0].mass == mass
    path.write_text(text.replace("name: comau_racer_1_4\n", "name: renamed\n"), encoding="utf-8")
    assert load_parameters(path).name == "renamed"


def test_missing_parameters_are_named(tmp_path):
    # a DELTA has parameters of another kind, the SCARA arm none
    for name in ("comau", "festo_expt_45", "scara_600"):
        with pytest.raises(InputError, match=r"of comau_racer_1_4, franka_emika_panda$"):
            load_parameters(name)
    with pytest.raises(InputError, match="cannot be read"):
        load_parameters(tmp_path / "none.yaml")


def test_defaults_are_valid_but_no_substitute_for_what_a_file_must_say(tmp_path):
    """Loading builds the defaults first, so they must pass the checks."""
    assert ArmParameters().denavit_hartenberg.table().axes == 1
    path = tmp_path / "robot.yaml"
    path.write_text("{name: mine}", encoding="utf-8")
    with pytest.raises(InputError, match="missing key 'denavit_hartenberg'"):
        load_parameters(path)


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (r"kind: box", "kind: cone", r"bodies\.base\[0\]\.kind = 'cone': must be one of box"),
        (r"material: dark", "material: pink", r"bodies\.base\[0\]\.material = 'pink': must be one"),
        (r"radius: 0\.155", "radius: 0", r"bodies\.base\[1\]\.radius = 0\.0: must be positive"),
        (r"radius: 0\.155", "radius: big", r"'bodies\.base\[1\]\.radius' is 'big': expected"),
        (r"radius: 0\.155", "radius: .inf", r"'bodies\.base\[1\]\.radius' is inf: expected .* m"),
        (r"end: \[0, 0, 0\.11\]", "end: [0, 0]", r"bodies\.base\[1\]\.end = .*must be 3"),
        (r"size: \[0\.40", "size: [-0.40", r"bodies\.base\[0\]\.size = .*must be positive"),
        (r"kind: box, ", "", r"missing key 'bodies\.base\[0\]\.kind': expected text"),
        (r"material: spring", "material: oak", r"elastic_axis_material = 'oak': must be one"),
        (r"body: \[0\.93", "body: [93", r"materials\.body = .*must be 4 numbers from 0 to 1"),
    ],
)
def test_wrong_appearance_names_file_and_key(tmp_path, pattern, replacement, message):
    text = (DIRECTORY / "appearance.yaml").read_text(encoding="utf-8")
    changed = re.sub(pattern, replacement, text, count=1)
    assert changed != text
    path = tmp_path / "appearance.yaml"
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_file(Appearance, path)
