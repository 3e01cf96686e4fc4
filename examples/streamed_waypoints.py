"""Path following along waypoints that come while the tool moves, twenty a second.

Halfway a new path begins: the tool changes to it without stopping. Run it with

    python examples/streamed_waypoints.py
"""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import StreamParameters, WaypointSender, add_path_streaming
from pfsc_drake.robot.models.files import models_directory

START = np.array([0.9, -0.3, 0.8])  # m
STREAM = StreamParameters(spacing=0.008, velocity=0.25)
RATE, DURATION, TURN = 20.0, 6.0, 40  # waypoints per second, s, number of a waypoint


def waypoint(k: int) -> np.ndarray:
    """Return a waypoint, on a wave and later on another one."""
    y, height = 0.01 * k, 0.04 if k < TURN else 0.02
    beside = np.array([height * np.sin(12.0 * y), y, height * (1.0 - np.cos(9.0 * y))])
    return START + beside


def main() -> None:
    """Simulate; print the distance travelled and the largest distance from the path."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
    model = models_directory() / "comau_racer_1_4" / "comau_racer_1_4_elastic.sdf"
    Parser(plant).AddModels(str(model))
    plant.Finalize()
    follower = add_path_streaming(builder, plant, "tool_point", START, stream=STREAM)
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())

    sender = WaypointSender(follower.messages)
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = follower.GetMyMutableContextFromRoot(root)
    port = follower.GetInputPort("waypoints")
    port.FixValue(context, sender.message)
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), follower.start_state)
    furthest = 0.0
    for k in range(1, int(RATE * DURATION)):
        if k <= 2 * TURN:
            sender.add(waypoint(k), new_path=k == TURN)
        port.FixValue(context, sender.message)
        simulator.AdvanceTo(k / RATE)
        state = follower.GetOutputPort("manifold_state").Eval(context)
        furthest = max(furthest, float(np.linalg.norm(state[1:3])))
    status, taken, left, _ = follower.GetOutputPort("stream").Eval(context)
    print(f"{1e3 * state[0]:.0f} mm along {taken:.0f} waypoints, {1e3 * left:.3f} mm left")
    print(f"{1e6 * furthest:.3f} um from the path at most, status {status:.0f}")


if __name__ == "__main__":
    main()
