"""Bounds that Tab. C.3 runs into, since no robot is like that."""

import numpy as np
import pytest

from identification.consistency.bounds import load_bounds
from identification.consistency.printed import nearest_to_printed
from identification.consistency.reached import reached_bounds
from identification.model.parameters import parameter_names, true_parameters
from pfsc_drake.errors import InputError


def test_a_robot_inside_its_bounds_reaches_none(panda, delta):
    for subject in (panda, delta):
        names = parameter_names(subject)
        assert reached_bounds(names, true_parameters(subject), load_bounds(subject.name)) == []


def test_the_wrist_of_the_table_is_as_thin_as_allowed(comau, comau_bounds):
    found = nearest_to_printed(comau)
    reached = reached_bounds(found.names, found.parameters, comau_bounds)
    assert "link_6: mass spreads as little as allowed in all directions, 0.01 m" in reached
    assert not any(name in line for line in reached for name in ("f_c", "f_v"))


def test_each_kind(comau, comau_bounds):
    names, parameters = parameter_names(comau), true_parameters(comau)
    before = reached_bounds(names, parameters, comau_bounds)
    parameters[20:30] *= 25.0 / parameters[20]
    comau_bounds.rotor_inertia[3] = [1e-5, parameters[63]]
    comau_bounds.links[4].center_of_mass.lower[0] = parameters[41] / parameters[40]
    parameters[66] = 0.0
    assert set(reached_bounds(names, parameters, comau_bounds)) - set(before) == {
        "link_3: mass is as small as allowed, 25 kg",
        "link_5: centre of mass is at the end of its box along x, 0.01962 m",
        "joint_4.I_M is as large as allowed, 6.963e-05",
        "joint_1.f_c is zero",
    }
    with pytest.raises(InputError, match=r"parameters: shape .77,.; must be .78,"):
        reached_bounds(names, np.ones(77), comau_bounds)
