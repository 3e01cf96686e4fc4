"""Path following in a diagram of your own, in ten lines.

A six-axis arm follows a closed spline through four points. Run it with

    python examples/own_diagram.py
"""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import WaypointTable, add_path_following, path_from_waypoints
from pfsc_drake.robot.models.files import models_directory

POINTS = [[0.9, -0.3, 0.8], [1.0, 0.0, 0.9], [0.9, 0.3, 0.8], [0.8, 0.0, 0.75]]  # m


def main() -> None:
    """Simulate a second; print the distance of the tool from the path."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    model = models_directory() / "comau_racer_1_4" / "comau_racer_1_4_elastic.sdf"
    Parser(plant).AddModels(str(model))
    plant.Finalize()

    path = path_from_waypoints(WaypointTable(np.array(POINTS)), smoothness=6, closed=True)
    follower = add_path_following(builder, plant, "tool_point", path, law="elastic")
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())

    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), follower.start_state)
    simulator.AdvanceTo(1.0)
    state = follower.GetOutputPort("manifold_state").Eval(follower.GetMyContextFromRoot(root))
    eta, *xi = state[:3]
    print(f"{1e3 * eta:.1f} mm along the path, {1e6 * np.linalg.norm(xi):.3f} um from it")


if __name__ == "__main__":
    main()
