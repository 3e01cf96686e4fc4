"""Blocks of a scenario that need a robot with masses."""

from diagrams.scenario.schema import Scenario
from diagrams.scenario.simulation import HoldBackParameters
from pfsc_drake.checks import require

_ALLOWED = "left out; links of the robot move without mass, so that kinematics alone are simulated"
_BLOCKS = ("hand", "operator", "teleoperation", "notch", "workpiece", "plate", "holder")


def check_massless(scenario: Scenario) -> None:
    """Refuse blocks that need masses, for a robot with kinematics alone.

    Args:
        scenario: The scenario; its law is ``velocity_servo``.

    Raises:
        InputError: If forces act, are measured or estimated, or the motion depends on torques.
    """
    controller, hold_back = scenario.controller, scenario.hold_back
    brakes = scenario.faults.brakes
    needs = {key: getattr(scenario, key) is not None for key in _BLOCKS} | {
        "forces": bool(scenario.forces),
        "pushes": bool(scenario.pushes),
        "hold_back": hold_back != HoldBackParameters(),
        "friction": scenario.friction.is_given,
        "drive_friction": bool(scenario.drive_friction),
        "controller.friction": controller.friction.is_given,
        "controller.external_torque.source": controller.external_torque.source != "none",
        "compliance": scenario.compliance.is_given,
        "model_error": scenario.model_error.is_given,
        "robot.rotor_coupling": bool(scenario.robot.rotor_coupling),
        "faults.brakes.torque": brakes is not None and bool(brakes.torque),
        "reference.speed": scenario.reference.speed == "fastest",
    }
    for key, is_set in needs.items():
        require(not is_set, key, "given", _ALLOWED)
