"""A hand pulls the tool through a ball that it must not enter; the tool slides around it.

The pull is scripted: it acts on the plant, and the controller measures it. Run it with

    python examples/hand_guided.py
"""

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import Frame
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

from pfsc_drake import SphereRegion, add_guidance
from pfsc_drake.robot.models.files import models_directory

START, BALL = [0.9, -0.25, 0.8], [0.92, 0.0, 0.82]  # m
PULL = np.array([0.0, 20.0, 0.0])  # N


class Hand(LeafSystem):
    """Force at the origin of a frame that increases within a tenth of a second."""

    def __init__(self, tool: Frame) -> None:
        """Apply the force to a tool."""
        super().__init__()
        self._tool, applied = tool, Value[list[ExternallyAppliedSpatialForce]]
        self.DeclareVectorOutputPort("wrench", 6, self._measure)
        self.DeclareAbstractOutputPort("applied_spatial_force", applied, self._apply)

    def _measure(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([*PULL * min(context.get_time() / 0.1, 1.0), 0.0, 0.0, 0.0])

    def _apply(self, context: Context, output: Value) -> None:
        force = ExternallyAppliedSpatialForce()
        force.body_index = self._tool.body().index()
        force.p_BoBq_B = self._tool.GetFixedPoseInBodyFrame().translation()
        wrench = self.GetOutputPort("wrench").Eval(context)
        force.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        output.set_value([force])


def main() -> None:
    """Simulate two seconds; print the largest depth in the ball and the distance travelled."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
    Parser(plant).AddModels(str(models_directory() / "comau_racer_1_4" / "comau_racer_1_4.sdf"))
    plant.Finalize()
    tool = plant.GetFrameByName("tool_point")

    ball = SphereRegion(BALL, 0.1, inside=False)
    start = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), START)
    follower = add_guidance(builder, plant, "tool_point", [ball], law="rigid", start=start)
    hand = builder.AddSystem(Hand(tool))
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(hand.GetOutputPort("wrench"), follower.GetInputPort("wrench"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    builder.Connect(
        hand.GetOutputPort("applied_spatial_force"), plant.get_applied_spatial_force_input_port()
    )

    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    plant.SetPositionsAndVelocities(context, follower.start_state)
    trail = [np.array(START)]
    for time in np.arange(0.005, 2.0, 0.005):
        simulator.AdvanceTo(time)
        trail.append(tool.CalcPoseInWorld(context).translation())
    deepest = max(0.0, -min(ball.distance(*point)[0] for point in trail))
    length = np.linalg.norm(np.diff(trail, axis=0), axis=1).sum()
    print(f"{1e3 * deepest:.3f} mm deep in the ball at most, {1e3 * length:.0f} mm travelled")


if __name__ == "__main__":
    main()
