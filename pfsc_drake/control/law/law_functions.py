"""What a law computes before and after the decoupling matrix is inverted, as CasADi functions."""

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np

from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.posture import Posture, posture_expressions
from pfsc_drake.control.law.stabilization import Stabilization
from pfsc_drake.control.manifolds.manifold import Kind, indices
from pfsc_drake.robot.robot_model import RobotModel


def law_function(
    robot: RobotModel,
    linearization: Linearization,
    stabilization: Stabilization,
    posture: Posture | None,
    *,
    damped: bool = False,
) -> ca.Function:
    """Return everything up to the decoupling matrix's inverse as one function.

    Args:
        robot: The robot.
        linearization: The relation between its drives and the virtual output.
        stabilization: Gains of the virtual output.
        posture: What joints beyond the number of outputs do; None if there are none.
        damped: Whether the inverse is damped near singular postures: joints that the outputs
            do not move there come to rest.
    """
    n, m = linearization.num_joints, linearization.num_outputs
    r = linearization.relative_degree
    state, tau_ext = ca.SX.sym("state", 4 * n), ca.SX.sym("tau_ext", n * max(r - 1, 0))
    point = ca.SX.sym("manifold_point", linearization.manifold.layout.size)
    reference, integral = ca.SX.sym("reference", (r + 1) * m), ca.SX.sym("integral", m)
    y_p = ca.vertsplit(reference, m)
    progress = []
    if linearization.manifold.follows_time:
        # the reference point moves with time, and the errors from it shall vanish
        along = indices(linearization.manifold.coordinates, Kind.TANGENTIAL)
        progress = [ca.vertcat(*[y[along] for y in y_p])]
        y_p = [ca.SX(m, 1)] * (r + 1)
    Y, A, b, gain, drift, offset, motion = linearization.function(state, tau_ext, point, *progress)
    last_output, angle = ca.SX.sym("last_output", m), ca.SX(0.0)
    turning = indices(linearization.manifold.coordinates, Kind.ROTATIONAL)
    if turning.stop:
        Y[turning, 0] += _whole_turns(last_output[turning] - Y[turning, 0])
        angle = ca.mmax(ca.fabs(Y[turning, 0] - y_p[0][turning]))
    v = stabilization.virtual_input(ca.horzsplit(Y), y_p, integral)
    arguments = {
        "state": state,
        "manifold_point": point,
        "reference": reference,
        "integral": integral,
        "tau_ext": tau_ext,
        "last_output": last_output,
    }
    results = {
        "Y": Y,
        "v": v,
        "A": A,
        "rhs": v - b,
        "gain": gain,
        "drift": drift,
        "offset": offset,
        "angle": angle,
    }
    if posture is not None:
        arguments["posture"] = ca.SX.sym("posture", (r + 1) * n)
        wanted = ca.vertsplit(arguments["posture"], n)
        wishes = posture_expressions(posture, robot, ca.horzsplit(motion), wanted)
        results |= {name: x for name, x in wishes._asdict().items() if x.numel()}
        if r > 1:
            results["velocity"] = motion[:, 1]
    elif damped:
        results["wish"] = _coming_to_rest(stabilization, ca.horzsplit(motion))
    return ca.Function(
        "following_law",
        list(arguments.values()),
        [ca.densify(result) for result in results.values()],
        list(arguments),
        list(results),
    )


def _coming_to_rest(stabilization: Stabilization, motion: Sequence[ca.SX]) -> ca.SX:
    """Return the highest joint derivative that brings joints to rest wherever they are.

    With the gains of the first coordinate but the one of its position; what is left of an error
    dynamics with real poles is stable.
    """
    wish = ca.SX(motion[0].numel(), 1)
    for gains, derivative in zip(stabilization.proportional[1:], motion[1:], strict=True):
        wish -= gains[0] * derivative
    return wish


def _whole_turns(angle: ca.SX) -> ca.SX:
    """Return the multiple of 2 pi nearest to each angle [rad]."""
    return 2.0 * math.pi * ca.floor(angle / (2.0 * math.pi) + 0.5)


def completion_function(linearization: Linearization, limits: np.ndarray) -> ca.Function:
    """Return everything after the decoupling matrix's inverse as one function.

    Args:
        linearization: The relation between drives and virtual output.
        limits: Of the drives, shape (N,).

    Its second result is finite only if all that went in and came out is: a sum is finite only if
    all its terms are, and the limits of the drives turn NaN into numbers.
    """
    n, m = linearization.num_joints, linearization.num_outputs
    r = linearization.relative_degree
    state, tau_ext = ca.SX.sym("state", 4 * n), ca.SX.sym("tau_ext", n * max(r - 1, 0))
    solution, drift, offset, last_held, friction = (ca.SX.sym(name, n) for name in "xdolf")
    gain, Y = ca.SX.sym("gain", n, n), ca.SX.sym("Y", m, r)
    v, rcond, lead = ca.SX.sym("v", m), ca.SX.sym("rcond"), ca.SX.sym("lead")
    held = gain @ solution + drift
    wanted = held + lead * (held - last_held) + offset + friction
    drive = ca.fmin(ca.fmax(wanted, -limits), limits)
    saturated = ca.sum1(ca.fabs(wanted) > limits)
    # the fault is judged outside
    result = ca.vertcat(drive, ca.vec(Y), v, 0.0, rcond, saturated, held)
    check = sum(ca.sum1(part) for part in (wanted, result, state, tau_ext))
    arguments = {
        "solution": solution,
        "gain": gain,
        "drift": drift,
        "offset": offset,
        "friction": friction,
        "last_held": last_held,
        "lead": lead,
        "Y": Y,
        "v": v,
        "rcond": rcond,
        "state": state,
        "tau_ext": tau_ext,
    }
    return ca.Function(
        "completion",
        list(arguments.values()),
        [ca.densify(result), ca.densify(check)],
        list(arguments),
        ["result", "check"],
    )
