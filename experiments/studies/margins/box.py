"""Box of model errors for an analysis of margins, and scenarios without nonlinear effects."""

import itertools
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

from diagrams.robots.model import is_delta
from diagrams.scenario import (
    HoldBackParameters,
    JointFrictionParameters,
    Scenario,
    SensorFailureParameters,
)
from diagrams.scenario.model_error import ModelErrorParameters
from pfsc_drake.errors import InputError

_FACTORS = {"mass": "masses", "stiffness": "stiffnesses", "rotor_inertia": "rotor inertias"}
_HEAVIEST = 1e4  # kg


@dataclass(frozen=True)
class ErrorBox:
    """Largest errors of the model, of either sign.

    Attributes:
        mass: Relative error of all masses and inertias.
        stiffness: Relative error of all joint stiffnesses.
        rotor_inertia: Relative error of all rotor inertias.
        tool_mass: Error of the tool's mass [kg].
    """

    mass: float = 0.05
    stiffness: float = 0.05
    rotor_inertia: float = 0.0
    tool_mass: float = 0.1

    def __post_init__(self) -> None:
        for key in _FACTORS:
            value = getattr(self, key)
            if not 0.0 <= value < 1.0:
                option = {"rotor_inertia": "rotor"}.get(key, key)
                raise InputError(f"--{option} {value:g}: allowed: 0 or a fraction below 1")
        if not 0.0 <= self.tool_mass <= _HEAVIEST:
            raise InputError(f"--tool {self.tool_mass:g}: allowed: 0 to {_HEAVIEST:g} kg")


@dataclass(frozen=True)
class Error:
    """Error of the nominal model, in units of the scenario's own ``model_error``.

    Attributes:
        parts: Relative errors by key of ``model_error``; for the tool in kg.
        unknown_mass: Unmodelled mass below the force sensor [kg].
    """

    parts: tuple[tuple[str, float], ...] = ()
    unknown_mass: float = 0.0

    def applied_to(self, settings: Scenario) -> Scenario:
        """Return a scenario whose controller has this error.

        Args:
            settings: The scenario; unchanged.
        """
        result = deepcopy(settings)
        error = result.model_error
        for key, amount in self.parts:
            if key == "tool_mass":
                error.tool_mass += amount
            else:
                setattr(error, key, [(1.0 + amount) * value for value in getattr(error, key)])
        return result

    def __str__(self) -> str:
        """Return the error in words."""
        if self.unknown_mass > 0.0:
            return f"{self.unknown_mass:g} kg unmodelled below the force sensor"
        if len(self.parts) > 1:
            return f"nominal {', '.join(_short(*part) for part in self.parts)}"
        return "".join(_words(*part) for part in self.parts) or "as the scenario says"


def _words(key: str, amount: float) -> str:
    if key == "tool_mass":
        return f"nominal tool {abs(amount):g} kg too {'heavy' if amount > 0.0 else 'light'}"
    side = "high" if amount > 0.0 else "low"
    return f"nominal {_FACTORS[key]} {100.0 * abs(amount):.3g} % too {side}"


def _short(key: str, amount: float) -> str:
    if key == "tool_mass":
        return f"tool {amount:+g} kg"
    return f"{_FACTORS[key]} {100.0 * amount:+.3g} %"


def single_errors(box: ErrorBox, elastic: bool) -> Iterator[tuple[str, Error]]:
    """Iterate over pairs of a parameter and its error, one parameter at a time.

    Args:
        box: The box.
        elastic: Whether the robot has joint stiffnesses.
    """
    for key, size in _sizes(box, elastic):
        for sign in (-1.0, 1.0):
            yield key, Error(((key, sign * size),))


def corners(box: ErrorBox, elastic: bool) -> Iterator[Error]:
    """Iterate over the corners of the box, with errors in all parameters.

    Args:
        box: The box.
        elastic: Whether the robot has joint stiffnesses.
    """
    sizes = _sizes(box, elastic)
    if len(sizes) > 1:
        for signs in itertools.product((-1.0, 1.0), repeat=len(sizes)):
            pairs = zip(sizes, signs, strict=True)
            yield Error(tuple((key, sign * size) for (key, size), sign in pairs))


def _sizes(box: ErrorBox, elastic: bool) -> list[tuple[str, float]]:
    keys = ("mass", "stiffness", "tool_mass", "rotor_inertia")
    sizes = [(key, getattr(box, key)) for key in keys if elastic or key != "stiffness"]
    return [(key, size) for key, size in sizes if size > 0.0]


# factor of the drives' limits, so that they are never reached
_UNLIMITED = 1e6


def smooth(settings: Scenario) -> tuple[Scenario, list[str]]:
    """Return a scenario without non-differentiable or external effects, and the list of these.

    Difference quotients, filters, disturbance observers, delays and the operator model remain as
    parts of the loop.

    Args:
        settings: The scenario; unchanged.
    """
    result, removed = deepcopy(settings), []
    # a model that errs asks for more at a state of one that does not; at its limit a drive is
    # no loop any more. A motion that these limits decide over leaves a reserve
    if settings.reference.speed != "fastest":
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
        # it would compensate friction that has been removed, and push at rest
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
    # a pressing tool starts beside the workpiece, which may be at the taught surface
    beside = any(settings.start.offset) and settings.workpiece is None
    if beside:
        result.start.offset = [0.0, 0.0]
    if beside or any(settings.start.rotation_deg):
        result.start.rotation_deg = [0.0, 0.0, 0.0]
        removed.append("start beside the path")
    result.simulation.sensor_failure = SensorFailureParameters()
    return result, removed


def without_error(settings: Scenario) -> Scenario:
    """Return a scenario with an exact model in the controller.

    Args:
        settings: The scenario; unchanged.
    """
    result = deepcopy(settings)
    result.model_error, result.controller.model = ModelErrorParameters(), ""
    return result
