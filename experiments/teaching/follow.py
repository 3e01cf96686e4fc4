"""The scenario of a robot that follows the path it was taught."""

import copy
from typing import Any

import numpy as np

from diagrams.scenario import Scenario
from experiments.teaching.taught import Taught, TeachingOptions, keeps_orientation
from pfsc_drake.following.options.controller import LawGains
from pfsc_drake.yaml.reading import TAG_KEY, dump_yaml
from pfsc_drake.yaml.typed import typed_data

CSV_NAME, YAML_NAME = "taught.csv", "follow.yaml"
TRANSITION, DWELL = 0.3, 0.5  # s
# what is the robot's, and not the task's
_KEPT = (
    "robot",
    "friction",
    "drive_friction",
    "encoders",
    "model_error",
    "controller",
    "servo",
    "simulation",
    "faults",
)
_GRID = 1e-4  # m, to which the end of the motion is rounded


def follow_scenario(taught: Taught, options: TeachingOptions) -> dict[str, Any]:
    """Return the scenario: the same robot, law and gains, on the taught path.

    Where the gains tell none for the transversal coordinates, they get those of the tangential
    ones. What is not given has its default.

    Args:
        taught: The path, whose waypoints are in ``CSV_NAME`` beside the scenario.
        options: How it fits, and how fast it is followed.
    """
    settings = taught.settings
    given, default = typed_data(settings), typed_data(Scenario())
    blocks = {key: _pruned(given[key], default[key]) for key in _KEPT if key in given}
    blocks["robot"] |= {key: given["robot"][key] for key in ("model", "tool_frame")}
    controller = blocks["controller"] | {"gains": _gains(settings), "manifold": "path"}
    if settings.controller.external_torque.source == "measured":
        blocks["sensor"] = _pruned(given["sensor"], default["sensor"])
    shape = {
        "file": CSV_NAME,
        "closed": options.closed,
        "tolerance": options.tolerance,
        "tolerance_deg": options.tolerance_deg,
        TAG_KEY: "!Waypoints",
    }
    length = taught.path.length if options.closed else _GRID * int(taught.path.length / _GRID)
    return {
        "name": f"{settings.name or 'taught'}_follow",
        "section": "5.3",
        "description": f"Path following along the path that a hand taught in {settings.name}.",
        **{key: block for key, block in blocks.items() if block not in ({}, None)},
        "path": {"shape": shape} | _orientation(settings),
        "controller": controller,
        "reference": {
            "points": [0.0, round(length, 6)],
            "velocity": options.velocity,
            "acceleration": options.acceleration,
            "dwell": DWELL,
        },
        "start": {"posture_deg": _posture(taught), "transition": TRANSITION},
    }


def follow_text(taught: Taught, options: TeachingOptions) -> str:
    """Return the same as the content of a file."""
    return dump_yaml(follow_scenario(taught, options))


def _pruned(given: Any, default: Any) -> Any:
    """Return what is not as it is anyway."""
    if not (isinstance(given, dict) and isinstance(default, dict)):
        return given
    if given.get(TAG_KEY) != default.get(TAG_KEY):
        return given
    return {
        key: _pruned(value, default.get(key)) if key in default else value
        for key, value in given.items()
        if key not in default or value != default[key]
    }


def _gains(settings: Scenario) -> dict[str, Any]:
    law = settings.controller.law
    gains = _pruned(typed_data(settings.controller.gains[law]), typed_data(LawGains()))
    if "xi" not in gains:
        gains["xi"] = copy.deepcopy(gains["eta"])
    return {law: gains}


def _orientation(settings: Scenario) -> dict[str, Any]:
    """Return what of the path's orientation the tool follows: what it kept while it was led."""
    if not keeps_orientation(settings):
        return {"orientation": {"task": "none"}}
    assert settings.fixtures is not None  # it keeps an orientation
    said = settings.fixtures.orientation
    if said.task == "full":
        return {}
    axis = {"tool_axis": "tool_axis", "yaw": "yaw_axis"}[said.task]
    return {"orientation": {"task": said.task, axis: list(getattr(said, axis))}}


def _posture(taught: Taught) -> list[float]:
    """Return the joint angles at the first waypoint [deg], or as the run was started.

    Those that joints of both kinds have are not told apart by the log.
    """
    log = taught.log
    signal = log["q_J_measured" if "q_J_measured" in log else "q_J"]
    q_J = signal.values[taught.rows[0]]
    if signal.unit == "m":
        return [round(value, 5) for value in q_J.tolist()]
    if signal.unit != "rad":
        return list(taught.settings.start.posture_deg)
    turns = np.round(np.rad2deg(q_J), 3).tolist()
    return [float(angle) for angle in turns]
