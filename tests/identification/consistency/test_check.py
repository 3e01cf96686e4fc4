"""Sets with one thing wrong, and mass matrices of Drake."""

import numpy as np
import pytest

from identification.consistency.parameter_files import (
    inconsistencies,
    require_consistent,
)
from identification.model.dynamic_parameters import parameter_names, true_parameters
from pfsc_drake.errors import InputError


@pytest.mark.parametrize("name", ["comau", "panda", "delta"])
def test_shipped_robots_are_consistent(name, request):
    subject = request.getfixturevalue(name)
    assert inconsistencies(subject, true_parameters(subject)) == []
    assert inconsistencies(subject, true_parameters(subject, friction=False)) == []


@pytest.mark.parametrize(
    ("changed", "value", "message"),
    [
        ("link_3.m", -0.2, "link_3: mass -0.2 kg; must be positive"),
        ("link_6.Izz", -0.0223, "link_6: principal moments of inertia .*none may be negative"),
        ("link_2.Izz", 50.0, "link_2: principal .*none may be above the sum of the other two"),
        ("joint_4.I_M", -1e-5, "joint_4.I_M = -1e-05: negative rotor inertia"),
        ("joint_1.f_c", -1.0, "joint_1.f_c = -1: negative friction"),
    ],
)
def test_names_what_is_wrong(comau, changed, value, message):
    parameters = true_parameters(comau)
    parameters[parameter_names(comau).index(changed)] = value
    assert len(inconsistencies(comau, parameters)) == 1
    with pytest.raises(InputError, match=f"comau_racer_1_4: not physically consistent: {message}"):
        require_consistent(comau, parameters)


def test_says_how_much_is_wrong(comau, delta):
    with pytest.raises(InputError, match="link_1: mass -1 kg; must be positive; and 23 more"):
        require_consistent(comau, np.full(78, -1.0))
    with pytest.raises(InputError, match=r"plate.m_y = 0 kg: must be positive$"):
        require_consistent(delta, np.array([1.0, 1.0, 1.0, 0.0]))
    with pytest.raises(InputError, match=r"parameters: link_1.mx = nan; must be finite"):
        require_consistent(comau, np.where(np.arange(78) == 1, np.nan, 1.0))
    with pytest.raises(InputError, match=r"parameters: shape .7,.; must be .78,"):
        require_consistent(comau, np.ones(7))
