"""Links behind elastic joints, found from their motors."""

import numpy as np
import pytest

from pfsc_drake.controller import link_state
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.errors import InputError


def test_friction_that_is_believed_is_no_torque_of_a_spring(load_arm, monkeypatch):
    told = []

    def note(robot, friction):
        told.append(friction)
        raise InputError("enough")

    monkeypatch.setattr(link_state, "motor_momentum", note)
    robot, f_c, f_v = load_arm("comau_racer_1_4_elastic_3r").chain, np.ones(3), 2.0 * np.ones(3)
    for friction in ((f_c, f_v), None):
        with pytest.raises(InputError, match="enough"):
            link_state._add_torque_observer(
                None, robot, ControllerParameters(), None, np.zeros(3), friction
            )
    np.testing.assert_array_equal(told, [[f_c, f_v], np.zeros((2, 3))])
