"""What of a scenario has a slope: the rest is taken off before a loop is linearized."""

from copy import deepcopy

from diagrams.robots.delta import is_delta
from diagrams.scenario import (
    HoldBackParameters,
    JointFrictionParameters,
    Scenario,
    SensorFailureParameters,
)
from diagrams.scenario.model_error import ModelErrorParameters

# times the drives' limits, which then nothing reaches
_UNLIMITED = 1e6


def smooth(settings: Scenario) -> tuple[Scenario, list[str]]:
    """Return a scenario without what has no slope or acts from outside, and what was taken off.

    Difference quotients, filters, disturbance observers, delays and the operator's hand stay:
    they are part of the loop.

    Args:
        settings: The scenario; unchanged.
    """
    result, removed = deepcopy(settings), []
    # a model that errs asks for more at a state of one that does not; at its limit a drive is
    # no loop any more
    result.controller.effort_scale *= _UNLIMITED
    removed.append("limits of the drives")
    rubs = settings.drive_friction is not False and is_delta(settings.robot.model)
    if settings.friction.is_given or rubs:
        result.friction = JointFrictionParameters()
        if is_delta(settings.robot.model):
            result.drive_friction = False
        removed.append("friction of the drives")
    compensation = result.controller.friction
    if compensation.has_coefficients or (
        compensation.watched and compensation.observer == "kalman"
    ):
        # it answers friction that is not there any more; around rest it would push
        compensation.source, compensation.watched = "none", False
        removed.append("compensation of friction by its coefficients")
    encoders = settings.encoders
    if any(encoders.link_increments) or any(encoders.motor_increments):
        result.encoders.link_increments, result.encoders.motor_increments = [], []
        removed.append("increments of the encoders")
    if settings.needs_sensor and any(settings.sensor.noise):
        result.sensor.noise = 0.0 * settings.sensor.noise
        removed.append("noise of the force sensor")
    if result.hand is not None and result.hand.tremor > 0.0:
        result.hand.tremor = 0.0
        removed.append("tremor of the hand")
    on_links = bool(settings.pushes) or any(pulse.link for pulse in settings.forces)
    on_tool = any(not pulse.link for pulse in settings.forces) or settings.hold_back.force != 0.0
    result.forces, result.pushes, result.hold_back = [], [], HoldBackParameters()
    removed += ["forces on the tool"] * on_tool + ["forces on links"] * on_links
    # what presses starts beside the workpiece, which may stand where the surface was taught
    beside = any(settings.start.offset) and settings.workpiece is None
    if beside:
        result.start.offset = [0.0, 0.0]
    if beside or any(settings.start.rotation_deg):
        result.start.rotation_deg = [0.0, 0.0, 0.0]
        removed.append("start beside the path")
    result.simulation.sensor_failure = SensorFailureParameters()
    return result, removed


def without_error(settings: Scenario) -> Scenario:
    """Return a scenario whose controller believes the truth.

    Args:
        settings: The scenario; unchanged.
    """
    result = deepcopy(settings)
    result.model_error, result.controller.model = ModelErrorParameters(), ""
    return result
