"""Drives of an MJCF model, with limits from actuators, joints and classes as in MuJoCo.

The force of an actuator on its joint is ``gear * clamp(gain * ctrl + bias, forcerange)``, the sum
of a joint's actuators is limited by its ``actuatorfrcrange``, and ``armature`` is inertia on the
joint's side. The control bounds the force where there is no bias; of servos (``position``,
``velocity``, affine bias) it is an angle or a speed and does not.
"""

import math
from dataclasses import dataclass

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.mjcf_classes import (
    Attributes,
    DefaultClasses,
    servo_attributes,
)
from pfsc_drake.robot.models.model_xml import Element, ModelXml


@dataclass(frozen=True)
class _Numbers:
    """Attributes of an element as numbers, with messages that name them."""

    model: ModelXml
    element: Element
    attributes: Attributes
    limits_by_range: bool

    def all(self, key: str) -> list[float]:
        text = self.attributes.get(key, "")
        try:
            return [float(word) for word in text.split()]
        except ValueError:
            raise InputError(
                f"{self.model.location(self.element)}: {self.element.name} "
                f"'{self.attributes.get('name', '')}': {key} = '{text}'; allowed: numbers"
            ) from None

    def of(self, key: str, otherwise: float) -> float:
        return next(iter(self.all(key)), otherwise)

    @property
    def stiffness(self) -> float:
        """Stiffness of a joint's spring; a spring with a torque at zero is refused."""
        stiffness = self.of("stiffness", 0.0)
        bent = self.of("springref", 0.0) - self.of("ref", 0.0)
        if stiffness > 0.0 and bent != 0.0:
            raise InputError(
                f"{self.model.location(self.element)}: joint '{self.attributes.get('name', '')}': "
                f"springref = {self.attributes.get('springref', '0')}; allowed: equal to ref, so "
                "that the spring rests at zero"
            )
        return stiffness

    def limit(self, kind: str) -> float:
        """Return the smaller side of an active range, else infinity."""
        values = self.all(f"{kind}range")
        limited = self.attributes.get(f"{kind}limited", "auto")
        if limited == "auto":
            limited = "true" if self.limits_by_range and values else "false"
        return min(map(abs, values), default=math.inf) if limited == "true" else math.inf


def _limit_of_actuator(numbers: _Numbers) -> tuple[float, str]:
    """Return the largest force of an actuator on its joint, and the attributes that define it."""
    gear = abs(numbers.of("gear", 1.0))
    force, source = numbers.limit("force"), "forcerange"
    if numbers.attributes.get("biastype", "none") == "none":
        by_control = abs(numbers.of("gainprm", 1.0)) * numbers.limit("ctrl")
        if by_control < force:
            force, source = by_control, "ctrlrange"
    if gear != 1.0:
        source += f" x gear {gear:g}"
    return gear * force, source


class MjcfDrive:
    """Drive of a joint.

    Args:
        joint: Attributes of the joint.
        actuators: Attributes of the actuators that drive it.

    Attributes:
        armature: Inertia of the rotor, on the joint's side [kg m^2 or kg].
        friction: Dry friction, ``frictionloss`` [Nm or N].
        stiffness: Stiffness of a spring at the joint [Nm/rad or N/m].
        is_actuated: Whether an actuator of the model drives the joint.
        effort_limit: Largest magnitude of the force on the joint, infinite if unlimited
            [Nm or N]; for an uneven range its smaller side.
        source: Attributes that define the limit.

    Raises:
        InputError: If an attribute is not made of numbers, or the spring does not rest at zero.
    """

    def __init__(self, joint: _Numbers, actuators: list[_Numbers]) -> None:
        self.armature, self.friction = joint.of("armature", 0.0), joint.of("frictionloss", 0.0)
        self.stiffness, self.is_actuated = joint.stiffness, bool(actuators)
        limits = [_limit_of_actuator(actuator) for actuator in actuators]
        total = sum(limit for limit, _ in limits) if limits else math.inf
        source = " + ".join(source for _, source in limits)
        if (of_joint := joint.limit("actuatorfrc")) < total:
            total, source = of_joint, "actuatorfrcrange"
        self.effort_limit = total
        self.source = source if total < math.inf else "no limit in the model"


def mjcf_drives(models: list[ModelXml]) -> dict[str, MjcfDrive]:
    """Return the drives of all joints of an MJCF model that have a name.

    Args:
        models: The model and what it includes.

    Raises:
        InputError: If a range, a gear or a gain is not made of numbers; one line.
    """
    roots = [model.root for model in models if model.root.name.startswith("mujoco")]
    classes, limits_by_range = DefaultClasses.of(models), True
    for root in roots:
        for compiler in root.all("compiler"):
            limits_by_range = compiler.attributes.get("autolimits", "true") != "false"
    model_of = {id(e): model for model in models for e in model.root.within()}
    joints: dict[str, _Numbers] = {}
    for world in (world for root in roots for world in root.all("worldbody")):
        for _, element, attributes in classes.below(world, "joint"):
            numbers = _Numbers(model_of[id(element)], element, attributes, limits_by_range)
            if "name" in attributes:
                joints[attributes["name"]] = numbers
            elif numbers.stiffness > 0.0:
                raise InputError(
                    f"{numbers.model.location(element)}: joint without a name: stiffness = "
                    f"{attributes['stiffness']}; allowed: 0, or a joint with a name"
                )
    driven: dict[str, list[_Numbers]] = {name: [] for name in joints}
    for root in roots:
        for element in (e for group in root.all("actuator") for e in group.children):
            attributes = classes.resolve(element, "actuator") | servo_attributes(element)
            joint = attributes.get("joint", attributes.get("jointinparent", ""))
            if joint in joints:
                numbers = _Numbers(model_of[id(element)], element, attributes, limits_by_range)
                driven[joint].append(numbers)
    return {name: MjcfDrive(numbers, driven[name]) for name, numbers in joints.items()}
