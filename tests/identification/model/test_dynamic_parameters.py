"""Order, names and true values of the dynamic parameters."""

import numpy as np
import pytest

from identification.model.dynamic_parameters import (
    link_moments,
    link_parameters,
    parameter_names,
    parameter_units,
    true_parameters,
)
from identification.model.subject import load_subject
from pfsc_drake.robot.models.files import resolve_model


@pytest.mark.parametrize(
    ("robot", "size"), [("comau_racer_1_4", 78), ("franka_emika_panda", 91), ("festo_expt_45", 10)]
)
def test_every_parameter_has_a_name_a_unit_and_a_value(subject_of, robot, size):
    subject = subject_of(robot)
    names, units = parameter_names(subject), parameter_units(subject)
    assert len(names) == len(set(names)) == len(units) == size
    assert true_parameters(subject).shape == (size,)
    inertial = len(parameter_names(subject, friction=False))
    assert inertial == size - 2 * subject.dimension
    assert true_parameters(subject, friction=False).shape == (inertial,)
    assert len(parameter_units(subject, friction=False)) == inertial


def test_values_stand_where_the_names_say(comau):
    values = dict(zip(parameter_names(comau), true_parameters(comau), strict=True))
    link = comau.chain.links[2]
    assert values["link_3.m"] == link.mass
    assert values["link_3.my"] == pytest.approx(link.mass * link.p_LC[1])
    assert values["link_3.Ixz"] == pytest.approx(link.inertia_about_origin[0, 2])
    assert values["joint_4.I_M"] == pytest.approx(6.962744e-05)
    assert values["joint_2.f_c"] == 101.7
    assert values["joint_6.f_v"] == 1.102


def test_units_follow_the_joints(delta, comau):
    assert parameter_units(delta)[-2:] == ["N", "N s/m"]
    assert parameter_units(comau)[-2:] == ["Nm", "Nm s/rad"]
    assert parameter_units(comau)[:5] == ["kg", "kg m", "kg m", "kg m", "kg m^2"]


def test_ten_parameters_and_back():
    rng = np.random.default_rng(0)
    inertia = rng.normal(size=(3, 3))
    inertia += inertia.T
    mass, moment, back = link_moments(link_parameters(2.0, np.array([0.1, 0.2, 0.3]), inertia))
    assert mass == 2.0
    np.testing.assert_allclose(moment, [0.2, 0.4, 0.6])
    np.testing.assert_array_equal(back, inertia)


def test_friction_that_nobody_knows_is_not_a_number(tmp_path, comau):
    file = tmp_path / "arm.sdf"
    file.write_text(resolve_model("comau_racer_1_4").read_text())
    assert np.all(np.isnan(true_parameters(load_subject(file))[-12:]))
