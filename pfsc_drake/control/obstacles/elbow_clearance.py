"""Null-space torques that keep an elbow clear of obstacles."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.geometry.segments import from_nearest
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import ArmOutline, outline_points
from pfsc_drake.yaml.rules import Parameters, Positive

# distance [m] below which an obstacle is on a joint and the direction is undefined
_ON_IT = 1e-6


@dc.dataclass
class ElbowParameters(Parameters):
    """Parameters of the repulsive force on an elbow.

    Attributes:
        room: Distance below which the force acts [m].
        stiffness: Stiffness of the force [N/m].
        force_limit: Largest force [N].
    """

    room: Positive = 0.4
    stiffness: Positive = 150.0
    force_limit: Positive = 30.0


class ElbowClearance(Block):
    """Joint torques that push the arm between shoulder and tool away from obstacles.

    A force acts on each point p of the arm's outline that is nearer than ``room`` to a part of an
    obstacle,

        f = min(k (room - d), f_max) n,    d = |p - p_O| - R - r,

    where n is the unit vector from the part to p, horizontal for a column. The torques
    ``sum J_p' f`` act on a compliant posture, see
    :class:`~pfsc_drake.control.compliance.posture_impedance.CompliantPosture`, which projects them
    into the null space of the outputs, so that the tool stays on its path. NaN or infinite torques
    are replaced by zero.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        obstacles (input): Position and velocity of K obstacles as measured, shape (6K,) [m, m/s].
        torque (output): Link-side torque, shape (N,) [Nm or N].

    Args:
        chain: Nominal model of the arm, N joints.
        outline: Outline of the arm.
        shapes: The obstacles.
        parameters: Parameters of the force.
        age: Age of the obstacle measurement [s].
    """

    def __init__(
        self,
        chain: SerialChain,
        outline: ArmOutline,
        shapes: Sequence[ObstacleShape],
        parameters: ElbowParameters,
        age: float,
    ) -> None:
        self._n = chain.dimension
        self._torque = _torque_function(chain, outline, shapes, parameters, age)
        self.inputs = {
            "joint_state": Port(4 * self._n, "rad, rad/s or m, m/s"),
            "obstacles": Port(6 * len(shapes), "m, m/s"),
        }
        self.outputs, self.states = {"torque": Port(self._n, "Nm or N")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        torque = self._torque(u.joint_state[: self._n], u.obstacles)
        return {"torque": where(all_finite(torque), torque, 0.0)}


@once_per_content()
def _torque_function(
    chain: SerialChain,
    outline: ArmOutline,
    shapes: Sequence[ObstacleShape],
    parameters: ElbowParameters,
    age: float,
) -> ca.Function:
    """Return ``(q, obstacles) -> torque``, see :class:`ElbowClearance`."""
    q, obstacles = ca.SX.sym("q", chain.dimension), ca.SX.sym("obstacles", 6 * len(shapes))
    # without the tool point, which stays on its path
    points = outline_points(chain, outline)(q)[: 3 * (len(outline.points) - 1)]
    forces = []
    for point in ca.vertsplit(points, 3):
        force = ca.SX(np.zeros(3))
        for shape, obstacle in zip(shapes, ca.vertsplit(obstacles, 6), strict=True):
            p_OP = shape.axes * (point - obstacle[:3] - age * obstacle[3:])
            for part in shape.parts:
                away = from_nearest(ca.DM(part.start), ca.DM(part.end), p_OP)
                length = ca.fmax(ca.norm_2(away), _ON_IT)
                left = parameters.room - (length - part.radius - outline.radius)
                push = ca.fmin(ca.fmax(parameters.stiffness * left, 0.0), parameters.force_limit)
                force += push * away / length
        forces.append(force)
    torque = ca.jtimes(points, q, ca.vertcat(*forces), True)
    return ca.Function(
        "elbow_torque", [q, obstacles], [ca.densify(torque)], ["q", "obstacles"], ["torque"]
    )
