"""Any diagram of blocks that controls as C99, in one call."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydrake.systems.framework import Diagram

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.codegen.project import write_project
from pfsc_drake.systems.fuse import fuse


def export(
    controller: Diagram, folder: str | Path, inputs: Mapping[str, np.ndarray] | None = None
) -> CController:
    """Write a controller as C99, with all that is needed to try it.

    ::

        follower = add_path_following(builder, plant, "tcp", path, law="elastic")
        export(follower, "controller", {"plant_state": np.tile(follower.start_state, (100, 1))})

    Args:
        controller: Diagram of blocks with an output ``fault``, its first output what drives are
            told, as a :class:`~pfsc_drake.Follower` is.
        folder: Where the files go; made if it does not exist. What they are is in ``README.md``.
        inputs: Values of all inputs at some ticks, each (ticks, size), which are recorded with
            what the controller makes of them, to be repeated in C; no record if omitted.

    Returns:
        The controller in C.

    Raises:
        InputError: If a part is no block, there is no ``fault``, or inputs do not suit.
    """
    whole = fuse(controller)
    title = controller.get_name() or "Controller"
    exported = CController.of(whole.network, whole.period, title=title)
    recorded = None if inputs is None else _recorded(exported, inputs)
    write_project(exported, Path(folder), recorded)
    return exported


def _recorded(controller: CController, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
    stepper = Stepper(controller.program.network)
    rows = []
    for values in zip(*inputs.values(), strict=True):
        given = dict(zip(inputs, values, strict=True))
        told = stepper.step(**given)
        network = controller.program.network
        parts = [*(given[name] for name in network.inputs), *(told[n] for n in network.outputs)]
        rows.append(np.concatenate([np.ravel(part) for part in parts]))
    return np.array(rows)
