"""The wrench that only slows the robot down, against Drake's dynamics."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from pfsc_drake.control.law.linearization import virtual_output_function
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import FourierCurve, OrientationCurve, Path
from pfsc_drake.physics.scripted_force import decoupled_force_function
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant


def test_only_the_arc_length_is_accelerated():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    tool = plant.GetFrameByName("tool_point")
    chain, _ = chain_from_plant(plant, tool)
    context = plant.CreateDefaultContext()
    q = np.deg2rad([20.0, 110.0, -30.0, 5.0, 85.0, -10.0])
    plant.SetPositions(context, q)
    y_t = tool.CalcPoseInWorld(context).translation()
    center = np.add(y_t, [0.0, 0.1, 0.02])
    curve = FourierCurve.circle(center, 0.12, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    path = Path(curve, OrientationCurve.fixed([0.2, 0.1, 0.9, 0.3], curve.domain))
    manifold = PathManifold(1, oriented=True)
    point = path.evaluator(1)(y_t.tolist(), path.nearest(y_t))

    wrench = np.array(decoupled_force_function(chain, manifold)(q, point)).ravel()
    J = plant.CalcJacobianSpatialVelocity(
        context,
        JacobianWrtVariable.kV,
        tool,
        [0, 0, 0],
        plant.world_frame(),
        plant.world_frame(),
    )
    tau = J.T @ np.concatenate([wrench[3:], wrench[:3]])
    acceleration = np.linalg.solve(plant.CalcMassMatrix(context), tau)
    # the rate of the virtual output is linear in the joint velocity
    rate = virtual_output_function(chain, manifold)
    effect = np.array(rate(q, acceleration, point))[:, 1]
    assert np.max(np.abs(effect[1:])) < 1e-12 * abs(effect[0])
    slope = point[manifold.layout.position][3:6]
    assert np.isclose(wrench[:3] @ slope / np.linalg.norm(slope), 1.0)
