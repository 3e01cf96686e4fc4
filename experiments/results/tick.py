"""How long one tick of the controller takes, measured on the states of a run."""

import time
from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Context

from diagrams.station import Station
from diagrams.tasks.space_guidance import SpaceTask
from experiments.results.run_log import RunLog

_SAMPLES = 1000
_JOINT_STATE = ("q_J", "v_J", "q_M", "v_M")


def measure_tick(station: Station, root: Context, log: RunLog) -> np.ndarray:
    """Evaluate the controller chain, from the joint state to the drives, at logged states.

    Args:
        station: The station that was simulated.
        root: Its context, which is overwritten.
        log: Log of the run.

    Returns:
        Wall clock time of each evaluation [s].
    """
    controller, blocks = station.controller, station.blocks
    sensor, rest = _sensor(station, root), _guidance(station, root)
    names = [name if name in log else name.replace("M", "J") for name in _JOINT_STATE]
    states = np.hstack([log[name].values for name in names])
    finite = np.isfinite(states).all(axis=1) & np.isfinite(log["theta"].values[:, 0])
    usable = np.flatnonzero(finite[1:] & finite[:-1]) + 1
    chosen = usable[:: max(1, len(usable) // _SAMPLES)]
    plant_states = [station.part.coordinates.plant_state(x) for x in states[chosen]]
    # a place is told by parameters and, where it is integrated, by arc lengths
    memory = station.task.place.layout.memory
    places = np.hstack([log["theta"].values, log["eta"].values])[:, : memory.stop - memory.start]
    elapsed = []
    for k, x in zip(chosen, plant_states, strict=True):
        root.SetTime(log.time[k])
        station.set_place(root, places[k - 1])
        station.place_robot(root, x)
        rest(log["y_t"].values[k - 1])
        # the controller compares what it measures with what it measured before
        controller.set_last_state(blocks, root, states[k - 1])
        sensor()  # what the plant needs to know its forces is not the controller's time
        begin = time.perf_counter()
        controller.drive(blocks, root)
        elapsed.append(time.perf_counter() - begin)
    return np.array(elapsed)


def _sensor(station: Station, root: Context) -> Callable[[], object]:
    """Return what makes the plant work out the forces in its joints, if they are measured."""
    name = "joint_reaction"
    if not station.diagram.HasSubsystemNamed(name):
        return lambda: None
    joint = station.diagram.GetSubsystemByName(name)
    reaction, context = joint.get_output_port(), joint.GetMyContextFromRoot(root)
    return lambda: reaction.Eval(context)


def _guidance(station: Station, root: Context) -> Callable[[np.ndarray], None]:
    """Return what lets guidance, if there is any, have been at a place before."""
    task = station.task
    if not isinstance(task, SpaceTask):
        return lambda y_t: None
    rest = task.guided.lead.start
    return lambda y_t: station.blocks.set_state(
        root, "fixture_guidance.lead", np.array(rest(y_t)).ravel()
    )
