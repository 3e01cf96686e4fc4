"""Position, orientation and force of a teleoperated tool, for the leader's side."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.rotations import matrix_of, rotation_of, rows_of
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function


class FixtureReaction(Block):
    """Guided position of the tool, and the force of regions and environment on it.

    Ports:
        record (input): Record of the guidance, see :class:`GuidanceRecord`.
        guides (input, with guides only): Record of the guides, see :class:`GuideRecord`.
        wrench (input, optional): Measured wrench of the environment on the tool, shape (6,)
            [N, Nm].
        position (output): ``z`` [m], shape (3,), the last one that was finite.
        felt (output): ``f + sum phi_i n_i`` plus the force of a guide, and with six axes the
            moment, shape (axes,) [N, Nm].

    State:
        last: ``z`` [m].

    Args:
        num_regions: Number M of regions.
        axes: Number of axes, 3 or 6.
        num_guides: Number K of guides.
    """

    def __init__(self, num_regions: int, axes: int = 3, num_guides: int = 0) -> None:
        self._record, self._axes = GuidanceRecord(num_regions), axes
        self._guides = GuideRecord(num_guides).fields
        self.inputs = {
            "record": Port(self._record.size),
            "wrench": Port(6, "N, Nm", optional=True),
        }
        if num_guides:
            self.inputs["guides"] = Port(GuideRecord(num_guides).size)
        self.outputs = {"position": Port(3, "m"), "felt": Port(axes, "N, Nm")}
        self.states = {"last": 3}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        z, near = (u.record[self._record.fields[name]] for name in ("point", "near"))
        slots = ca.reshape(near, len(SLOT), -1).T
        n = slots[:, SLOT.index("n_x") : SLOT.index("n_z") + 1]
        felt = n.T @ slots[:, SLOT.index("phi")]
        moment = ca.DM.zeros(3)
        if "guides" in self.inputs:
            closest_point, kappa = (u.guides[self._guides[name]] for name in ("foot", "kappa"))
            felt += kappa * (closest_point - z)
        if u.wrench is not None:
            felt, moment = felt + u.wrench[:3], u.wrench[3:]
        felt = ca.vertcat(felt, moment)[: self._axes]
        known = all_finite(z, felt)
        return {"position": where(known, z, x.last), "felt": where(known, felt, 0.0)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"last": y.position}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"last": u.record[self._record.fields["point"]]}


class CommandedPoint(Block):
    """Predicted rest position of a tool on a path or a surface, and the measured force.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        wrench (input): Measured wrench of the environment on the tool, shape (6,) [N, Nm].
        position (output): ``y_t + lag y_t'`` [m], shape (3,).
        felt (output): Force of the wrench, and with six axes its moment, shape (axes,) [N, Nm].

    Args:
        robot: Nominal robot model.
        lag: Lag between the commanded and the actual position [s].
        axes: Number of axes, 3 or 6.
    """

    def __init__(self, robot: RobotModel, lag: float, axes: int = 3) -> None:
        self._size, self._lag, self._axes = robot.dimension, lag, axes
        self._motion = tool_motion_function(robot)
        self.inputs = {
            "joint_state": Port(4 * robot.dimension, "rad, rad/s or m, m/s"),
            "wrench": Port(6, "N, Nm"),
        }
        self.outputs, self.states = {"position": Port(3, "m"), "felt": Port(axes, "N, Nm")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n = self._size
        motion = self._motion(u.joint_state[:n], u.joint_state[n : 2 * n])
        position = motion[:3] + self._lag * motion[12:15]
        return {"position": position, "felt": u.wrench[: self._axes]}


class CommandedOrientation(Block):
    """Predicted rest orientation of a tool.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        orientation (output): ``exp(lag [w]) R_e`` by rows, shape (9,).

    Args:
        robot: Nominal robot model.
        lag: Lag between the commanded and the actual orientation [s].
    """

    def __init__(self, robot: RobotModel, lag: float) -> None:
        self._size, self._lag = robot.dimension, lag
        self._motion = tool_motion_function(robot)
        self.inputs = {"joint_state": Port(4 * robot.dimension, "rad, rad/s or m, m/s")}
        self.outputs, self.states = {"orientation": Port(9)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n = self._size
        motion = self._motion(u.joint_state[:n], u.joint_state[n : 2 * n])
        R = rotation_of(self._lag * motion[15:18]) @ matrix_of(motion[3:12])
        return {"orientation": rows_of(R)}
