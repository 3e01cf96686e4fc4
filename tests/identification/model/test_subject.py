"""The robot under test, from a name, a model file or a scenario."""

import numpy as np
import pytest

from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters

COMAU = "comau_racer_1_4"


def test_the_robot_without_tool_matches_the_parameter_file(comau):
    """Link 6 without the tool, whose frame differs from DH frame 6 by an offset along z only."""
    link, own = comau.chain.links[-1], load_parameters(COMAU).links[-1]
    np.testing.assert_allclose(link.mass, own.mass, rtol=1e-9)
    np.testing.assert_allclose(link.p_LC, own.center_of_mass + np.array([0, 0, 0.1]), atol=1e-9)
    np.testing.assert_allclose(link.I_C, own.inertia_matrix(), atol=1e-9)


def test_with_its_tool_the_last_link_is_heavier(comau):
    with_tool = load_subject(COMAU, tool=True)
    added = with_tool.chain.links[-1].mass - comau.chain.links[-1].mass
    np.testing.assert_allclose(added, load_parameters(COMAU).tool.mass, rtol=1e-9)


def test_limits_friction_and_rotors_are_those_of_the_file(comau):
    file = load_parameters(COMAU)
    np.testing.assert_allclose(comau.acceleration_limit, file.joint_limits.acceleration, rtol=1e-6)
    np.testing.assert_allclose(comau.velocity_limit, file.joint_limits.velocity, rtol=1e-6)
    np.testing.assert_allclose(comau.position_limits[:, 0], file.joint_limits.position_lower)
    np.testing.assert_allclose(comau.effort_limit, file.joint_limits.effort)
    np.testing.assert_allclose(comau.gear_ratio, file.rotors.gear_ratio)
    np.testing.assert_allclose(comau.coulomb, file.friction.coulomb)
    np.testing.assert_allclose(comau.viscous, file.friction.viscous)
    assert [mount.link for mount in comau.mounts] == file.rotors.fixed_to_link
    assert comau.joint_units == ["rad"] * 6


def test_delta_robots_have_no_chain(delta):
    assert delta.chain is None
    assert delta.mounts is None
    assert delta.joint_units == ["m"] * 3
    np.testing.assert_allclose(delta.coulomb, [5.0, 5.0, 5.0])
    assert np.all(np.isinf(delta.acceleration_limit))


def test_a_file_is_as_good_as_a_name(comau):
    subject = load_subject(resolve_model(COMAU))
    assert subject.name == COMAU
    assert subject.chain.links[-1].mass == comau.chain.links[-1].mass


def test_a_model_that_nothing_else_is_known_of(tmp_path):
    """No tool frame, no gear ratios, no friction: the last body counts."""
    text = resolve_model(COMAU).read_text()
    start = text.index('<frame name="tool_point"')
    stop = text.index("</frame>", start) + len("</frame>")
    file = tmp_path / "arm.sdf"
    file.write_text(text[:start] + text[stop:])
    subject = load_subject(file)
    assert subject.dimension == 6
    assert subject.parameters is None
    assert subject.coulomb is None
    assert subject.mounts is None
    np.testing.assert_allclose(subject.gear_ratio, [90, 90, 60, 50, 50, 35])


def test_a_scenario_names_a_robot_and_where_it_hangs(tmp_path, comau):
    file = tmp_path / "ceiling.yaml"
    file.write_text(
        "robot: {model: comau_racer_1_4, base_pose: {position: [0, 0, 2], zyx_deg: [0, 0, 180]}}\n"
    )
    subject = load_subject(file)
    assert subject.name == "ceiling"
    np.testing.assert_allclose(subject.chain.links[0].p_PF, [0, 0, 2])
    assert len(subject.mounts) == 6
    assert subject.chain.links[-1].mass == comau.chain.links[-1].mass


def test_an_elastic_model_is_the_same_robot(comau):
    elastic = load_subject("comau_racer_1_4_elastic")
    np.testing.assert_allclose(elastic.gear_ratio, comau.gear_ratio)
    np.testing.assert_allclose(elastic.acceleration_limit, comau.acceleration_limit, rtol=1e-6)


def test_what_is_no_robot_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"comau_racer_1_5.*comau_racer_1_4"):
        load_subject("comau_racer_1_5")
    file = tmp_path / "empty.yaml"
    file.write_text("name: nothing\n")
    with pytest.raises(InputError, match=r"empty\.yaml: no block 'robot'"):
        load_subject(file)
