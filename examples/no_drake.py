"""A controller outside of a Drake diagram: joint state in, torques out, once a millisecond.

Drake reads the model; the loop itself is one compiled function. Here the robot rests at the start,
so that the torques hold its weight and begin its motion.

    python examples/no_drake.py
"""

import time

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import WaypointTable, add_path_following, path_from_waypoints
from pfsc_drake.robot.models.files import models_directory

POINTS = [[0.9, -0.3, 0.8], [1.0, 0.0, 0.9], [0.9, 0.3, 0.8], [0.8, 0.0, 0.75]]  # m
TICKS = 2000


def main() -> None:
    """Step the controller; print torques and time."""
    plant = MultibodyPlant(time_step=0.0)
    model = models_directory() / "comau_racer_1_4" / "comau_racer_1_4_elastic.sdf"
    Parser(plant).AddModels(str(model))
    plant.Finalize()
    path = path_from_waypoints(WaypointTable(np.array(POINTS)), smoothness=6, closed=True)
    follower = add_path_following(DiagramBuilder(), plant, "tool_point", path, law="elastic")

    controller = follower.stepper()
    measured = follower.start_state  # [q, v], from your robot
    outputs = controller.step(plant_state=measured)
    print("drive torques [Nm]:", np.round(outputs["drive_torque"], 1))

    begin = time.perf_counter()
    for _ in range(TICKS):
        outputs = controller.step(plant_state=measured)
    duration = 1e6 * (time.perf_counter() - begin) / TICKS
    print(f"{duration:.0f} us a tick, fault {outputs['fault'][0]:.0f}")


if __name__ == "__main__":
    main()
