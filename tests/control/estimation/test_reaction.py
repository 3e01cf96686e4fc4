"""The reaction of a process, against Drake's spatial forces."""

import numpy as np
from pydrake.multibody.math import SpatialForce
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.reaction import Reaction


def test_action_and_reaction_balance_about_any_point():
    rng = np.random.default_rng(3)
    wrench, y_t, p_WC = rng.uniform(-1.0, 1.0, 6), *rng.uniform(-1.0, 1.0, (2, 3))
    turns = Rotation.random(2, rng).as_matrix().reshape(2, 9)
    outputs = Stepper(Reaction()).step(
        wrench=wrench,
        tool_pose=np.append(y_t, turns[0]),
        workpiece_pose=np.append(p_WC, turns[1]),
    )["reaction"]
    about = rng.uniform(-1.0, 1.0, 3)
    total = np.zeros(6)
    for acting, point in ((wrench, y_t), (outputs, p_WC)):
        force = SpatialForce(tau=acting[3:], f=acting[:3])
        total += force.Shift(about - point).get_coeffs()
    assert np.abs(total).max() < 1e-14
