"""Shipped scenarios, and robots as Drake alone knows them."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from diagrams.robots.model import read_robot, tool_frame
from diagrams.scenario import RobotParameters, Scenario
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from tests.scenarios import shipped_scenario


class Arm:
    """A robot in Drake's plant. Joints are found by name, nothing uses the extracted chain."""

    def __init__(self, model: str) -> None:
        parameters = RobotParameters(model)
        self.plant: MultibodyPlant = read_robot(parameters, Path())[0]
        self.tool = tool_frame(self.plant, parameters)
        self.chain, self.coordinates = chain_from_plant(self.plant, self.tool)
        self.n = self.chain.dimension
        self.context = self.plant.CreateDefaultContext()

    def set_state(self, x: np.ndarray) -> None:
        """Set the plant's state ``[q, v]``."""
        self.plant.SetPositionsAndVelocities(self.context, x)

    def angles(self, kind: str) -> np.ndarray:
        """Return the angles of the joints ``<kind>_1 ..``, shape (n,)."""
        joints = [self.plant.GetJointByName(f"{kind}_{i + 1}") for i in range(self.n)]
        return np.array([joint.get_angle(self.context) for joint in joints])

    def tool_pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ``y_t`` and ``R_e``."""
        X_WT = self.tool.CalcPoseInWorld(self.context)
        return X_WT.translation(), X_WT.rotation().matrix()

    def weight(self, q: np.ndarray) -> np.ndarray:
        """Return the joint torques that hold the arm against gravity; rigid arms only."""
        self.plant.SetPositions(self.context, q)
        return -self.plant.CalcGravityGeneralizedForces(self.context)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Return ``d y_t / dq``, shape (3, n); rigid arms only."""
        self.plant.SetPositions(self.context, q)
        world = self.plant.world_frame()
        return self.plant.CalcJacobianTranslationalVelocity(
            self.context, JacobianWrtVariable.kV, self.tool, [0, 0, 0], world, world
        )


@pytest.fixture(scope="session")
def load_arm():
    return cache(Arm)


@pytest.fixture
def load_scenario():
    """Return a fresh copy of a shipped scenario, to be changed; its systems can be looked at."""

    def load(name: str) -> Scenario:
        settings = shipped_scenario(name)
        settings.simulation.fused = False
        return settings

    return load


@pytest.fixture
def load_exact_scenario(load_scenario):
    """Return a fresh copy of a shipped scenario whose controller knows and sees the truth."""

    def load(name: str) -> Scenario:
        settings, plain = load_scenario(name), Scenario()
        for key in ("friction", "encoders", "model_error"):
            setattr(settings, key, getattr(plain, key))
        settings.controller.friction = plain.controller.friction
        settings.start.transition = 0.0
        return settings

    return load
