"""A three-axis robot with any joints elastic, moved by Drake alone."""

from functools import cache

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from scipy.integrate import solve_ivp

from pfsc_drake.robot.models.elastic_joints import ElasticJoints
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

STIFFNESS = {
    "rigid": [np.inf, np.inf, np.inf],
    "elastic": [3.5e4, 6.2e4, 1.9e4],
    "mixed": [3.5e4, np.inf, 1.9e4],
}
DAMPING, BEARINGS = np.array([20.0, 30.0, 10.0]), (1.5, 2.5, 0.5)
Q, V = np.array([0.3, 1.3, -0.5]), np.array([0.4, -0.7, 0.9])


class DrakeArm:
    """The plant in the coordinates ``[q_J, v_J, q_M, v_M]``, and its chain."""

    def __init__(self, kind):
        K_s = np.array(STIFFNESS[kind])
        elastic = np.isfinite(K_s)
        options = ModelOptions()
        if elastic.any():
            K_d = np.where(elastic, DAMPING, 0.0)
            options = ModelOptions(elastic=ElasticJoints(stiffness=K_s, damping=K_d))

        def dampen(plant):
            for i, (bends, value) in enumerate(zip(elastic, BEARINGS, strict=True)):
                names = (f"joint_{i + 1}_motor", f"motor_{i + 1}", f"joint_{i + 1}")
                name = next(n for n in names if plant.HasJointNamed(n))
                assert not bends or name != names[2] or not plant.HasJointNamed(names[0])
                plant.GetJointByName(name).set_default_damping(value)

        self.plant = MultibodyPlant(0.0)
        read_model(self.plant, resolve_model("comau_racer_1_4_3r"), options, dampen)
        self.chain, self.coordinates = chain_from_plant(
            self.plant, self.plant.GetFrameByName("tool_point")
        )
        self.elastic = elastic
        assert np.array_equal(np.isfinite(self.chain.K_s), elastic)
        assert np.array_equal(self.chain.viscous_damping, BEARINGS)
        self.rows = np.vstack([self.coordinates.link_rows, self.coordinates.motor_rows])
        self.context = self.plant.CreateDefaultContext()
        positions = self.plant.num_positions()
        self.links, self.motors = (
            rows[3:, positions:]
            for rows in (self.coordinates.link_rows, self.coordinates.motor_rows)
        )

    def state(self):
        """Return a state in motion, elastic joints bent."""
        bend = np.where(self.elastic, [0.004, -0.003, 0.005], 0.0)
        return np.concatenate([Q, V, Q + bend, V + 20.0 * bend])

    def rates(self, state, drive, friction, tau_ext):
        """Return the time derivative of ``[q_J, v_J, q_M, v_M]``, all torques of shape (3,)."""
        self.plant.SetPositionsAndVelocities(self.context, self.coordinates.plant_state(state))
        actuation = np.zeros(self.plant.num_actuators())
        actuation[self.coordinates.actuators] = drive
        self.plant.get_actuation_input_port().FixValue(self.context, actuation)
        port = self.plant.get_applied_generalized_force_input_port()
        port.FixValue(self.context, self.links.T @ tau_ext - self.motors.T @ friction)
        return self.rows @ self.plant.EvalTimeDerivatives(self.context).CopyToVector()

    def move(self, drives, friction, tau_ext, period):
        """Return the states at the ticks, with each drive torque held for a period.

        ``friction`` and ``tau_ext`` are functions of the time.
        """
        states = [self.state()]
        for k, drive in enumerate(drives):
            solution = solve_ivp(
                lambda t, x, drive=drive: self.rates(x, drive, friction(t), tau_ext(t)),
                (k * period, (k + 1) * period),
                states[-1],
                method="DOP853",
                rtol=1e-9,
                atol=1e-11,
            )
            states.append(solution.y[:, -1])
        return np.array(states)


@pytest.fixture(scope="session")
def drake_arm():
    return cache(DrakeArm)
