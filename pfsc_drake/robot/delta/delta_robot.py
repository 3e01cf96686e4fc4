"""The DELTA robot with linear drives as a model for control laws, and its nominal model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_parameters import NUM_ARMS, DeltaParameters
from pfsc_drake.robot.delta.kinematics import RodMotion, joint_coordinates, rod_motion
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.robot_model import RobotModel, bias_torque


@dataclass(frozen=True)
class DeltaRobot(RobotModel):
    """Kinematics and dynamics (2.72) of the DELTA robot, rigid and without friction.

    A :class:`~pfsc_drake.robot.robot_model.RobotModel`, so that all laws apply.

    Coordinates are the slide positions q [m], from the base plate towards P. The
    end-effector only translates. All vectors are in axes of the inertial frame, whose z_0
    points down. The rods are two point masses each, so that slides and end-effector have
    effective masses (Sec. 2.4.5)::

        D(q) q'' + C(q, q') q' + g(q) = tau_d - tau_f + J_D^T f_ext            (2.42), (2.72)

    Attributes:
        parameters: Physical parameters; not to be changed afterwards.
    """

    parameters: DeltaParameters

    @property
    def dimension(self) -> int:
        """Number of joints N = 3."""
        return NUM_ARMS

    @property
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration in the inertial frame [m/s^2], shape (3,)."""
        return self.parameters.gravity

    def gather(self, attribute: str) -> np.ndarray:
        """Return one attribute of all joints, named as in ``ChainLink``.

        Args:
            attribute: ``effort_limit`` [N], ``velocity_limit`` [m/s], ``position_limits`` [m],
                ``reflected_inertia``, ``stiffness``, ``damping``, ``viscous_damping``, ``kind``,
                ``is_revolute`` or ``name``.

        Returns:
            Shape (3,), for ``position_limits`` (3, 2).

        Raises:
            AttributeError: If joints of this robot have no such attribute.
        """
        drives = self.parameters.drives
        values = {
            "name": np.array([f"slide_{i + 1}" for i in range(NUM_ARMS)]),
            "kind": np.full(NUM_ARMS, "prismatic"),
            "is_revolute": np.full(NUM_ARMS, False),
            "reflected_inertia": np.zeros(NUM_ARMS),
            "stiffness": np.full(NUM_ARMS, np.inf),
            "damping": np.zeros(NUM_ARMS),
            "viscous_damping": np.zeros(NUM_ARMS),
            "effort_limit": drives.effort.copy(),
            "velocity_limit": drives.velocity.copy(),
            "position_limits": np.column_stack([drives.position_lower, drives.position_upper]),
        }
        if attribute not in values:
            raise AttributeError(f"'{attribute}'; joints have {', '.join(values)}")
        return values[attribute]

    def tool_pose(self, q: Sequence[Jet]) -> tuple[Jet, Jet]:
        """Return the end-effector's position and its orientation, which is constant.

        Args:
            q: Slide positions [m], three scalar jets of order r >= 0.

        Returns:
            ``y_t`` [m], vector jet of order r, and ``R_e``, matrix jet of order r.
        """
        y_t = self._motion(q).y_t
        return y_t, jets.constant(ca.SX.eye(3), y_t.order)

    def inverse_dynamics(self, q: Sequence[Jet]) -> list[Jet]:
        """Return ``D(q) q'' + C(q, q') q' + g(q)`` of (2.72), without friction.

        Newton's law for each mass, with the end-effector's force transmitted by the rods::

            tau = D_q q'' + g_q + J_D^T m_y (y_t'' - gravity),   g_q,i = m_q gravity . c_i

        Args:
            q: Slide positions [m], three scalar jets of order r >= 2.

        Returns:
            Three scalar jets of order r - 2 [N].
        """
        masses, motion = self.parameters.masses, self._motion(q)
        acceleration = motion.y_t.differentiate().differentiate()
        load_forces = motion.slide_forces((acceleration - self.gravity) * masses.effective_plate)
        weight = masses.effective_slide * (self.parameters.geometry.rails @ self.gravity)
        return [
            q_i.differentiate().differentiate() * masses.effective_slide
            + weight[i]
            + load_forces[i]
            for i, q_i in enumerate(q)
        ]

    def mass_matrix(self, q: ca.SX) -> ca.SX:
        """Return ``D(q) = D_q + J_D^T D_y J_D`` (2.72a) [kg], shape (3, 3).

        Args:
            q: Slide positions [m], shape (3, 1).
        """
        masses, J_D = self.parameters.masses, self.jacobian(q)
        return masses.effective_slide * ca.SX.eye(NUM_ARMS) + masses.effective_plate * (J_D.T @ J_D)

    def jacobian(self, q: ca.SX) -> ca.SX:
        """Return the manipulator Jacobian ``J_D = d y_t / d q`` (2.33), shape (3, 3).

        Args:
            q: Slide positions [m], shape (3, 1).
        """
        return self._motion([Jet([q_i]) for q_i in ca.vertsplit(q)]).jacobian()

    def acceleration(self, q: ca.SX, v: ca.SX, force: ca.SX, f_ext: ca.SX) -> ca.SX:
        """Return q'' of (2.72) [m/s^2], shape (3, 1).

        Args:
            q: Slide positions [m], shape (3, 1).
            v: Slide velocities [m/s], shape (3, 1).
            force: Drive forces less friction [N], shape (3, 1).
            f_ext: External force at the end-effector [N], shape (3, 1).
        """
        pushed = force + self.jacobian(q).T @ f_ext - bias_torque(self, q, v)
        return ca.ldl_solve(pushed, *ca.ldl(self.mass_matrix(q)))

    def tool_position(self, q: np.ndarray) -> np.ndarray:
        """Return the end-effector position ``h_D(q)`` [m], shape (3,).

        Args:
            q: Slide positions [m], shape (3,). Where the rods cannot meet the result is NaN.
        """
        return np.array(self._numeric(q)[0]).ravel()

    def jacobian_at(self, q: np.ndarray) -> np.ndarray:
        """Return the manipulator Jacobian (2.33) as numbers, shape (3, 3).

        Args:
            q: Slide positions [m], shape (3,).
        """
        return np.array(self._numeric(q)[1])

    def joint_coordinates(self, y_t: np.ndarray, name: str = "tool point") -> np.ndarray:
        """Return the slide positions of an end-effector position (2.27) [m], shape (3,).

        Args:
            y_t: End-effector position [m], shape (3,).
            name: Name of the point in the message.

        Raises:
            InputError: If the point is outside the workspace; the message names the limit.
        """
        return joint_coordinates(self.parameters, y_t, name)

    def _motion(self, q: Sequence[Jet]) -> RodMotion:
        return rod_motion(self.parameters.geometry, q)

    @cached_property
    def _numeric(self) -> ca.Function:
        q = ca.SX.sym("q", NUM_ARMS)
        motion = self._motion([Jet([q_i]) for q_i in ca.vertsplit(q)])
        return ca.Function("delta", [q], [motion.y_t.coefficients[0], motion.jacobian()])


def nominal_delta(robot: DeltaRobot, error: ModelError) -> DeltaRobot:
    """Return the nominal model of a DELTA robot.

    Its three kinds of links are slides, rods and end-effector with load; their lengths are
    ``l_A``, ``l_BC`` and ``l_EC``.

    Args:
        robot: The actual robot.
        error: Errors of the model, N = 3.

    Raises:
        InputError: If an error does not apply to the robot, or its value is impossible.
    """
    if np.any(error.joint_offset):
        raise InputError(
            f"joint_offset = {error.joint_offset.tolist()}; allowed: 0 for a DELTA robot, whose "
            "slides are homed at their ends"
        )
    masses, geometry = robot.parameters.masses, robot.parameters.geometry
    slide, rod, plate = error.mass
    load = masses.load * plate + error.tool_mass
    if load < 0.0:
        raise InputError(
            f"tool_mass = {error.tool_mass:g} kg; allowed: {-masses.load * plate:g} kg or more"
        )
    l_A, l_BC, l_EC = error.link_length
    return DeltaRobot(
        replace(
            robot.parameters,
            masses=replace(
                masses,
                slide=masses.slide * slide,
                rod_pair=masses.rod_pair * rod,
                plate=masses.plate * plate,
                load=load,
            ),
            geometry=replace(
                geometry,
                l_A=geometry.l_A * l_A,
                l_BC=geometry.l_BC * l_BC,
                l_EC=geometry.l_EC * l_EC,
            ),
        )
    )
