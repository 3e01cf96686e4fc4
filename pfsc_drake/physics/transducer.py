"""What a force/torque sensor bears, and what it makes of that in a tick, as functions."""

import casadi as ca
import numpy as np

from pfsc_drake.control.compliance.tool_load import ToolLoad, predicted_load
from pfsc_drake.control.estimation.low_pass import LowPass
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel


def transducer_function(
    low_pass: LowPass, bias: np.ndarray, measurement_range: np.ndarray
) -> ca.Function:
    """Return what a sensor makes of its load, ``clip(lowpass(load) + bias + noise)``.

    Args:
        low_pass: The amplifier's filter.
        bias: Reading without load, shape (6,) [N, Nm].
        measurement_range: Largest magnitude that is measured, shape (6,) [N, Nm].

    Returns:
        ``(reaction, state, noise) -> (reading, load, next_state)``, each (6,). The reaction
        is ``[torque, force]`` on the tool, as in Drake, the load ``[force, torque]`` its
        opposite. The filter rests on the load where its state is NaN; a load that is NaN is
        read as NaN.
    """
    reaction, memory, noise = (ca.SX.sym(name, 6) for name in ("reaction", "state", "noise"))
    load = -ca.vertcat(reaction[3:], reaction[:3])
    state = ca.if_else(_is_nan(memory), low_pass.rest(load), memory)
    reading = low_pass.output(state, load) + bias + noise
    # unlike a minimum, a comparison lets NaN through
    reading = ca.if_else(reading > measurement_range, measurement_range, reading)
    reading = ca.if_else(reading < -measurement_range, -measurement_range, reading)
    return ca.Function(
        "transducer",
        [reaction, memory, noise],
        ca.cse([ca.densify(x) for x in (reading, load, low_pass.update(state, load))]),
        ["reaction", "state", "noise"],
        ["reading", "load", "next_state"],
    )


def _is_nan(value: ca.SX) -> ca.SX:
    return ca.logic_not(ca.fabs(value) <= ca.inf)


def tool_reaction_function(robot: RobotModel, load: ToolLoad) -> ca.Function:
    """Return what the joint between flange and tool exerts on the tool.

    By Newton and Euler on the tool alone: the opposite of :func:`predicted_load` and of the
    wrench that acts on the tool, moved to the sensor's origin.

    Args:
        robot: The robot.
        load: Everything behind the sensor.

    Returns:
        ``(q, v, a, wrench) -> reaction``: link coordinates, velocities, accelerations, each
        (N,); wrench ``[force, torque]`` at the tool point in world axes, shape (6,); reaction
        ``[torque, force]`` on the tool in S, shape (6,) [Nm, N].
    """
    n = robot.dimension
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    wrench = ca.SX.sym("wrench", 6)
    joints = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(n)]
    predicted, R_WS = predicted_load(robot, load, joints)
    force, torque = R_WS.T @ wrench[:3], R_WS.T @ wrench[3:]
    total = predicted + ca.vertcat(force, torque + ca.cross(ca.SX(load.p_ST), force))
    reaction = -ca.vertcat(total[3:], total[:3])
    return ca.Function(
        "tool_reaction",
        [q, v, a, wrench],
        ca.cse([ca.densify(reaction)]),
        ["q", "v", "a", "wrench"],
        ["reaction"],
    )
