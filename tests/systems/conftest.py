"""A three-axis robot, a path and a law for tests of single systems."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import least_squares

from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import CoordinateGains, Stabilization, gains_from_poles
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import FourierCurve, Path
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant


class Arm:
    """The rigid three-axis robot, its chain, and a place beside the path."""

    def __init__(self):
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.tool = self.plant.GetFrameByName("tool_point")
        self.chain, _ = chain_from_plant(self.plant, self.tool)

    def pose(self, q):
        """Return ``[y_t, R_e]`` from Drake, shape (12,)."""
        self.plant.SetPositions(self.context, q)
        X_WT = self.tool.CalcPoseInWorld(self.context)
        return np.concatenate([X_WT.translation(), X_WT.rotation().matrix().ravel()])

    def reach(self, y_t):
        """Return joint coordinates that bring the tool to a point."""
        return least_squares(lambda q: self.pose(q)[:3] - y_t, [0.2, 1.6, -0.5], xtol=1e-15).x

    def weight(self, q):
        """Return the torques that hold the arm against gravity."""
        self.plant.SetPositions(self.context, q)
        return -self.plant.CalcGravityGeneralizedForces(self.context)


@pytest.fixture(scope="session")
def arm():
    return Arm()


@pytest.fixture(scope="session")
def path():
    return Path(FourierCurve.bent_lemniscate())


@pytest.fixture(scope="session")
def make_law(arm):
    """Return the rigid law of the arm with poles at -20."""

    def make(integral=0.0, law="rigid", limit=2000.0, **changes):
        options = ActuationOptions(1e-3)
        linearization = linearize(
            arm.chain, law, PathManifold(RELATIVE_DEGREE[law], oriented=False), options
        )
        r = linearization.relative_degree
        gains = CoordinateGains(gains_from_poles([-20.0] * r).proportional, integral)
        stabilization = Stabilization([gains] * 3, r, ["eta", "xi_1", "xi_2"])
        return FollowingLaw(
            arm.chain,
            linearization,
            stabilization,
            DecouplingInverse(1e-3),
            limits=np.full(3, limit),
            max_alpha=0.8,
            safe_state=SafeState(np.full(3, 30.0)),
            **changes,
        )

    return make
