"""Checks of the numbers of a robot model before Drake reads it.

Drake replaces an unphysical inertia, ends the program at other invalid numbers, and accepts the
rest. Here each is refused in one line that names file, line, part and value.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.mjcf_drives import MjcfDrive, mjcf_drives
from pfsc_drake.robot.models.model_parts import (
    DRIVE_NUMBERS,
    MOMENTS,
    PRODUCTS,
    Mimic,
    ModelPart,
    check_inertia,
    check_joint,
    mimics_of,
    refuse_loops,
)
from pfsc_drake.robot.models.model_xml import Element, ModelXml


@dataclass
class ModelFacts:
    """Data of a model file that Drake's plant does not provide.

    Attributes:
        without_inertia: Location of each link without ``<inertial>``, by its name.
        assumed_inertia: Links for whose moments of inertia SDF takes 1 kg m^2.
        effort_limits: Effort limits of joints of URDF and MJCF, by name [Nm or N].
        position_limits: Position limits of joints of URDF and SDF, by name [rad or m]; infinite
            where there are none.
        drives: Drives of MJCF joints, by name.
        friction: Joints with dry friction.
        springs: Stiffness of the sprung joints of the model itself, by name.
        mimics: Joints that follow others, by name.
        still: Joints of the type fixed.
    """

    without_inertia: dict[str, str] = field(default_factory=dict)
    assumed_inertia: list[str] = field(default_factory=list)
    effort_limits: dict[str, float] = field(default_factory=dict)
    position_limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    drives: dict[str, MjcfDrive] = field(default_factory=dict)
    friction: list[str] = field(default_factory=list)
    springs: dict[str, float] = field(default_factory=dict)
    mimics: dict[str, Mimic] = field(default_factory=dict)
    still: set[str] = field(default_factory=set)

    def with_followers(self, fixed: Mapping[str, float]) -> dict[str, float]:
        """Return the positions of fixed joints and their followers.

        Args:
            fixed: Positions of joints that are fixed, by name [rad or m]; positions of followers
                are used unchanged.

        Raises:
            InputError: If a joint follows one that moves, or itself.
        """
        positions = dict(fixed)

        def position(name: str, waiting: tuple[str, ...]) -> float:
            if name in positions:
                return positions[name]
            if name in self.still:
                return 0.0
            mimic = self.mimics.get(name)
            if mimic is None or name in waiting:
                follower = self.mimics[waiting[0]]
                raise InputError(
                    f"{follower.location}: joint '{waiting[0]}': mimic = {follower.leader}, which "
                    "moves; allowed: joints on their own: fix the one that it follows, and it is "
                    f"fixed too: fixed_joints: {{{name}: VALUE}}"
                )
            return mimic.multiplier * position(mimic.leader, (*waiting, name)) + mimic.offset

        for name in self.mimics.keys() - self.still:
            positions[name] = position(name, ())
        return positions


def inspect_model(models: list[ModelXml], fixed: frozenset[str] = frozenset()) -> ModelFacts:
    """Check the numbers and the joints of a model.

    Args:
        models: The model and what it includes.
        fixed: Joints that will not move, even if they do in the model.

    Raises:
        InputError: If a number is invalid or out of range, an inertia is not physical, or joints
            close a loop; one line.
    """
    facts = ModelFacts()
    for model in models:
        inspect = _INSPECTORS.get(model.root.name)
        if inspect is not None:
            inspect(model, facts, fixed)
            facts.mimics |= mimics_of(model)
    facts.drives = mjcf_drives(models)
    facts.effort_limits |= {name: drive.effort_limit for name, drive in facts.drives.items()}
    for name, drive in facts.drives.items():
        if drive.stiffness > 0.0 and drive.is_actuated:
            raise InputError(
                f"{models[0].file}: joint '{name}': stiffness = {drive.stiffness:g} beside an "
                "actuator; allowed: 0, or a joint of its own behind the driven one; of an elastic "
                "gear write robot.elastic"
            )
        if drive.stiffness > 0.0:
            facts.springs[name] = drive.stiffness
    facts.friction += [name for name, drive in facts.drives.items() if drive.friction > 0.0]
    return facts


def _inspect_urdf(model: ModelXml, facts: ModelFacts, fixed: frozenset[str]) -> None:
    for element in model.root.all("link"):
        link = ModelPart(model, element, "link")
        inertial = element.first("inertial")
        if inertial is None:
            facts.without_inertia[link.name] = model.location(element)
            continue
        _check_origin(link, inertial)
        mass, inertia = inertial.first("mass"), inertial.first("inertia")
        check_inertia(
            link,
            None if mass is None else mass.attributes.get("value"),
            {} if inertia is None else inertia.attributes,
            inertial,
        )
    edges = []
    for element in model.root.all("joint"):
        joint = ModelPart(model, element, "joint")
        _check_origin(joint, element)
        parent, child = (_attribute(element, end, "link") for end in ("parent", "child"))
        edges.append((joint, parent, child))
        values = {
            key: (part.attributes[key], part)
            for name, keys in _URDF_JOINT.items()
            for part in element.all(name)
            for key in keys
            if key in part.attributes
        }
        _take_joint(joint, values, facts, fixed)
    refuse_loops(edges, {})
    for actuator in model.root.all("transmission", "actuator"):
        drive = ModelPart(model, actuator, "actuator")
        for key, allowed in DRIVE_NUMBERS.items():
            for part in actuator.all(key):
                drive.number(key, part.attributes.get("value"), allowed, part)


def _take_joint(
    joint: ModelPart,
    values: dict[str, tuple[str, Element]],
    facts: ModelFacts,
    fixed: frozenset[str],
) -> None:
    """Check a joint of a URDF or SDF model, and store data that Drake's plant does not provide."""
    numbers = check_joint(joint, values, fixed)
    lower, upper = numbers.get("lower", -math.inf), numbers.get("upper", math.inf)
    facts.position_limits[joint.name] = lower, upper
    if "effort" in numbers and joint.model.root.name == "robot":
        facts.effort_limits[joint.name] = numbers["effort"]
    if numbers.get("friction", 0.0) > 0.0:
        facts.friction.append(joint.name)
    if numbers.get("spring_stiffness", 0.0) > 0.0:
        facts.springs[joint.name] = numbers["spring_stiffness"]
    if joint.element.attributes.get("type") == "fixed":
        facts.still.add(joint.name)


def _check_origin(part: ModelPart, holder: Element) -> None:
    for name, keys in (("origin", ("xyz", "rpy")), ("axis", ("xyz",))):
        for element in holder.all(name):
            for key in keys:
                part.check_numbers(f"{name} {key}", element.attributes.get(key), element)


def _inspect_sdf(model: ModelXml, facts: ModelFacts, fixed: frozenset[str]) -> None:
    for one in (element for element in model.root.within() if element.name == "model"):
        for element in one.all("link"):
            link = ModelPart(model, element, "link")
            inertial = element.first("inertial")
            if inertial is None:
                facts.without_inertia[link.name] = model.location(element)
                continue
            if inertial.attributes.get("auto", "").strip() in ("true", "1"):
                link.refuse("inertial auto", "true", "mass and inertia in numbers", inertial)
            inertia = inertial.first("inertia")
            moments = {} if inertia is None else {c.name: c.text for c in inertia.children}
            if check_inertia(link, _text(inertial, "mass"), moments, inertial):
                facts.assumed_inertia.append(link.name)
        edges = []
        for element in one.all("joint"):
            joint = ModelPart(model, element, "joint")
            parent, child = ((_text(element, end) or "").strip() for end in ("parent", "child"))
            edges.append((joint, parent, child))
            values = {
                key: (part.text, part)
                for path, keys in _SDF_JOINT.items()
                for above in element.all(*path)
                for key in keys
                for part in above.all(key)
            }
            _take_joint(joint, values, facts, fixed)
            for key, allowed in DRIVE_NUMBERS.items():
                for part in element.all(key):
                    joint.number(key, part.text, allowed, part)
        _check_poses(model, one)
        frames = {
            frame.attributes.get("name", ""): frame.attributes.get("attached_to", "")
            for frame in one.all("frame")
        }
        refuse_loops(edges, frames)


def _check_poses(model: ModelXml, one: Element) -> None:
    for kind in ("link", "joint", "frame"):
        for element in one.all(kind):
            part = ModelPart(model, element, kind)
            for path in (("pose",), ("inertial", "pose"), ("axis", "xyz")):
                for pose in element.all(*path):
                    part.check_numbers(" ".join(path), pose.text, pose)


def _inspect_mjcf(model: ModelXml, facts: ModelFacts, fixed: frozenset[str]) -> None:
    for element in (e for e in model.root.within() if e.name == "body"):
        body = ModelPart(model, element, "body")
        for key in ("pos", "quat", "euler", "axisangle"):
            body.check_numbers(key, element.attributes.get(key), element)
        for inertial in element.all("inertial"):
            attributes = inertial.attributes
            moments = attributes.get("fullinertia") or attributes.get("diaginertia", "")
            named = dict(zip((*MOMENTS, *PRODUCTS), moments.split(), strict=False))
            check_inertia(body, attributes.get("mass"), named, inertial)
        for element_of_joint in element.all("joint"):
            joint_attributes = element_of_joint.attributes
            limits = dict(
                zip(("lower", "upper"), joint_attributes.get("range", "").split(), strict=False)
            )
            values = limits | {
                k: joint_attributes[k] for k in ("damping", "armature") if k in joint_attributes
            }
            placed = {key: (text, element_of_joint) for key, text in values.items()}
            check_joint(ModelPart(model, element_of_joint, "joint"), placed, fixed)
    for equality in model.root.all("equality"):
        for constraint in equality.children:
            if constraint.name == "joint":  # one follows the other
                continue
            ModelPart(model, constraint, "equality").refuse(
                "type", constraint.name, "an open chain without constraints", constraint
            )


_INSPECTORS = {
    "robot": _inspect_urdf,
    "sdf": _inspect_sdf,
    "mujoco": _inspect_mjcf,
    "mujocoinclude": _inspect_mjcf,
}

_URDF_JOINT = {
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
}
_SDF_JOINT = {
    ("axis", "limit"): ("lower", "upper", "effort", "velocity"),
    ("axis", "dynamics"): ("damping", "friction", "spring_stiffness", "spring_reference"),
}


def _text(element: Element, name: str) -> str | None:
    part = element.first(name)
    return None if part is None else part.text


def _attribute(element: Element, part_name: str, name: str) -> str | None:
    part = element.first(part_name)
    return None if part is None else part.attributes.get(name)
