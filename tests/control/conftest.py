"""Robots as Drake knows them, paths and laws that several tests use."""

from functools import cache

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import CoordinateGains, Stabilization, gains_from_poles
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import (
    FourierCurve,
    Path,
    interpolate_orientation,
    quaternion_to_matrix,
    zyx_to_quaternion,
)
from pfsc_drake.robot.models.elastic_joints import ElasticJoints
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

# of joints beyond the number of outputs [1/s]
POSTURE_POLES = (-14.0, -17.0, -19.0, -23.0)
# bent arms of six axes and of seven [rad]
BENT = (0.2, 1.6, -0.5, 0.1, 1.2, 0.1)
BENT_7 = (0.1, -0.7, 0.2, -2.3, 0.1, 1.6, 0.7)
NAMES = ("eta", "xi_1", "xi_2", "phi_1", "phi_2", "phi_3")


class Robot:
    """A plant of Drake in the coordinates ``[q_J, v_J, q_M, v_M]``, and its extracted chain.

    Nothing in here uses the chain's own kinematics and dynamics.
    """

    def __init__(self, model, joint_damping=(), drive_damping=(), stiffness=()):
        self.plant = MultibodyPlant(0.0)
        if stiffness:
            elastic = ElasticJoints(np.array(stiffness), np.array(joint_damping))
            read_model(self.plant, resolve_model(model), ModelOptions(elastic=elastic))
        else:
            self._read(model, joint_damping, drive_damping)
        self.tool = self.plant.GetFrameByName("tool_point")
        self.chain, self.coordinates = chain_from_plant(self.plant, self.tool)
        self.n = self.chain.dimension
        self.context = self.plant.CreateDefaultContext()
        self._rows = np.vstack([self.coordinates.link_rows, self.coordinates.motor_rows])
        nq = self.plant.num_positions()
        self._link_velocity = self.coordinates.link_rows[self.n :, nq:]

    def _read(self, model, joint_damping, drive_damping):
        Parser(self.plant).AddModels(str(resolve_model(model)))
        for i, damping in enumerate(joint_damping):
            self.plant.GetJointByName(f"flex_{i + 1}").set_default_damping(damping)
        drive = "motor" if self.plant.HasJointNamed("motor_1") else "joint"
        for i, damping in enumerate(drive_damping):
            self.plant.GetJointByName(f"{drive}_{i + 1}").set_default_damping(damping)
        self.plant.Finalize()

    def set_state(self, state):
        """Set ``[q_J, v_J, q_M, v_M]``; the last two are ignored by a rigid robot."""
        rows = self._rows if self.chain.is_elastic else self.coordinates.link_rows
        state = state[: len(rows)]
        self.plant.SetPositionsAndVelocities(self.context, np.linalg.solve(rows, state))

    def rates(self, state, drive, tau_ext):
        """Return the time derivative of ``[q_J, v_J, q_M, v_M]`` from Drake's plant."""
        # the plant itself would clip silently
        assert np.all(np.abs(drive) <= self.chain.gather("effort_limit"))
        self.set_state(state)
        actuation = np.zeros(self.plant.num_actuators())
        actuation[self.coordinates.actuators] = drive
        self.plant.get_actuation_input_port().FixValue(self.context, actuation)
        port = self.plant.get_applied_generalized_force_input_port()
        port.FixValue(self.context, self._link_velocity.T @ tau_ext)
        return self._rows @ self.plant.EvalTimeDerivatives(self.context).CopyToVector()

    def tool_pose(self, state):
        """Return ``y_t`` and ``R_e``."""
        self.set_state(state)
        X_WT = self.tool.CalcPoseInWorld(self.context)
        return X_WT.translation(), X_WT.rotation().matrix()

    def link_dynamics(self, q, v):
        """Return ``D_E(q)`` and ``n_E(q, v)`` of (2.65a); rigid robots only."""
        self.set_state(np.concatenate([q, v]))
        mass = self.plant.CalcMassMatrix(self.context) - np.diag(self.chain.D_M)
        gravity = self.plant.CalcGravityGeneralizedForces(self.context)
        return mass, self.plant.CalcBiasTerm(self.context) - gravity

    def jacobian(self, q):
        """Return the geometric Jacobian, rows angular then linear; rigid robots only."""
        self.set_state(np.concatenate([q, np.zeros(self.n)]))
        world = self.plant.world_frame()
        return self.plant.CalcJacobianSpatialVelocity(
            self.context, JacobianWrtVariable.kV, self.tool, [0, 0, 0], world, world
        )

    def reach(self, y_t, R_e=None, guess=None):
        """Return joint coordinates that bring the tool to a pose."""
        if guess is None:
            guess = BENT_7 if self.n == 7 else BENT

        def error(q):
            y, R = self.tool_pose(np.concatenate([q, 0 * q, q, 0 * q]))
            return y - y_t if R_e is None else np.concatenate([y - y_t, (R - R_e).ravel()])

        solution = least_squares(error, guess[: self.n], xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert solution.cost < 1e-20
        return solution.x


@pytest.fixture(scope="session")
def load_robot():
    @cache
    def load(model, joint_damping=(), drive_damping=(), stiffness=()):
        return Robot(model, joint_damping, drive_damping, stiffness)

    return load


@pytest.fixture(scope="session")
def oriented_path():
    """Bent lemniscate with an orientation that swings on all three angles."""
    theta = np.linspace(0.0, 2.0 * np.pi, 13)
    swing = [0.25 * np.sin(2 * theta), -0.25 * np.cos(theta), -0.25 * np.sin(theta)]
    angles = np.stack(swing, axis=1) + np.array([np.pi, -0.26, 0.0])
    orientation = interpolate_orientation(
        zyx_to_quaternion(angles), theta, smoothness=5, closed=True
    )
    return Path(FourierCurve.bent_lemniscate(), orientation)


@pytest.fixture(scope="session")
def small_path():
    """Tilted circle within reach of a small arm, with an orientation that nods and sways."""
    theta = np.linspace(0.0, 2.0 * np.pi, 13)
    swing = [0.3 * np.sin(theta), 0.25 * np.cos(theta), 0.2 * np.sin(2 * theta)]
    angles = np.stack(swing, axis=1) + np.array([0.0, 0.1, np.pi])
    orientation = interpolate_orientation(
        zyx_to_quaternion(angles), theta, smoothness=5, closed=True
    )
    circle = FourierCurve.circle([0.45, 0.05, 0.4], 0.12, [1.0, 0.0, 0.2], [0.0, 1.0, 0.1])
    return Path(circle, orientation)


@pytest.fixture(scope="session")
def position_path():
    return Path(FourierCurve.bent_lemniscate())


@pytest.fixture(scope="session")
def virtual_output():
    """Return the outputs of a tool pose from the path alone, ``(eta, xi_1, xi_2[, phi])``."""

    def calc(path, y_t, R_e):
        theta = path.nearest(y_t)
        sigma, slope = path.position.derivatives(theta, 1)
        e_par, e_perp = slope / np.linalg.norm(slope), path.frame.normals(theta)[0]
        offset = y_t - sigma
        y = [path.arc_length(theta), e_perp @ offset, np.cross(e_par, e_perp) @ offset]
        if path.orientation is None:
            return np.array(y)
        R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
        return np.array([*y, *Rotation.from_matrix(R_d.T @ R_e).as_euler("ZYX")])

    return calc


@pytest.fixture(scope="session")
def make_law():
    """Return a law with different poles on every coordinate and limits out of reach."""

    def make(chain, law, oriented=True, **changes):
        sampling_time = changes.pop("sampling_time", 0.0)
        damping = changes.pop("boundary_layer_damping", None)
        integral = changes.pop("integral", 0.0)
        weight, coordinate = changes.pop("weight", None), changes.pop("coordinate", None)
        options = ActuationOptions(sampling_time, damping)
        path = PathManifold(RELATIVE_DEGREE[law], oriented=oriented)
        linearization = linearize(chain, law, changes.pop("manifold", path), options)
        r, m, n = RELATIVE_DEGREE[law], linearization.num_outputs, chain.dimension
        poles = [[-20.0 - 3.0 * i - 2.0 * k for k in range(r)] for i in range(m)]
        gains = [CoordinateGains(gains_from_poles(p).proportional, integral) for p in poles]
        posture = None
        if n > m:
            own = Stabilization([gains_from_poles(POSTURE_POLES[:r])] * n, r, ["posture"] * n)
            posture = Posture(own, weight, coordinate)
        arguments = {
            "robot": chain,
            "linearization": linearization,
            "stabilization": Stabilization(gains, r, NAMES[:m]),
            "inverse": DecouplingInverse(1e-6),
            "limits": np.full(n, 1e9),
            "max_alpha": 0.9,
            "safe_state": SafeState(np.full(n, 50.0)),
            "posture": posture,
        }
        return FollowingLaw(**(arguments | changes))

    return make
