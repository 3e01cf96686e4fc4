"""What is wrong with the numbers of a robot model, found before Drake reads it.

Drake takes a stand-in for an inertia that it does not like, ends the program at other numbers,
and lets the rest through. Here each is refused in one line that names file, line, part and value.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.multibody.tree import RotationalInertia

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.model_xml import Element, ModelXml

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)
_MOMENTS = ("ixx", "iyy", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")
_ONE_AXIS = ("revolute", "prismatic", "hinge", "slide")

_ANY, _LIMIT, _NOT_NEGATIVE, _POSITIVE = (
    "a finite number",
    "a number",
    "zero or a positive number",
    "a positive number",
)


@dataclass
class ModelFacts:
    """What a model file says that Drake's plant does not.

    Attributes:
        without_inertia: Where each link without ``<inertial>`` stands, by its name.
        effort_limits: Effort limits of URDF joints, by name [Nm or N].
        friction: Joints with dry friction.
        springs: Stiffness of the sprung joints of the model itself, by name.
        mimics: Number of joints that follow others; all of them are fixed.
    """

    without_inertia: dict[str, str] = field(default_factory=dict)
    effort_limits: dict[str, float] = field(default_factory=dict)
    friction: list[str] = field(default_factory=list)
    springs: dict[str, float] = field(default_factory=dict)
    mimics: int = 0


@dataclass(frozen=True)
class _Part:
    """A link or joint and where its numbers stand."""

    model: ModelXml
    element: Element
    kind: str

    @property
    def name(self) -> str:
        return self.element.attributes.get("name", "")

    def number(self, key: str, text: str | None, allowed: str, at: Element | None = None) -> float:
        """Return a number, or refuse what it is instead."""
        written = "" if text is None else text.strip()
        value = np.nan
        if _NUMBER.fullmatch(written) or _INFINITE.fullmatch(written):
            value = float(written)
        valid = {
            _ANY: np.isfinite(value),
            _LIMIT: not np.isnan(value),
            _NOT_NEGATIVE: np.isfinite(value) and value >= 0.0,
            _POSITIVE: np.isfinite(value) and value > 0.0,
        }[allowed]
        if not valid:
            self.refuse(key, written or "empty", allowed, at)
        return value

    def refuse(self, key: str, value: object, allowed: str, at: Element | None = None) -> None:
        shown = str(value) if len(str(value)) < 60 else f"{str(value)[:57]}..."
        raise InputError(
            f"{self.model.place(at or self.element)}: {self.kind} '{self.name}': "
            f"{key} = {shown}; allowed: {allowed}"
        )


def inspect_model(models: list[ModelXml], fixed: frozenset[str] = frozenset()) -> ModelFacts:
    """Check the numbers and the joints of a model.

    Args:
        models: The model and what it includes.
        fixed: Joints that will not move, whatever the model says.

    Raises:
        InputError: If a number is none or out of range, an inertia is not physical, joints close
            a loop, or a joint mimics another; one line.
    """
    facts = ModelFacts()
    for model in models:
        inspect = _INSPECTORS.get(model.root.name)
        if inspect is not None:
            inspect(model, facts, fixed)
    return facts


def _inspect_urdf(model: ModelXml, facts: ModelFacts, fixed: frozenset[str]) -> None:
    for element in model.root.all("link"):
        link = _Part(model, element, "link")
        inertial = element.first("inertial")
        if inertial is None:
            facts.without_inertia[link.name] = model.place(element)
            continue
        mass, inertia = inertial.first("mass"), inertial.first("inertia")
        _check_inertia(
            link,
            None if mass is None else mass.attributes.get("value"),
            {} if inertia is None else inertia.attributes,
            inertial,
        )
    edges = []
    for element in model.root.all("joint"):
        joint = _Part(model, element, "joint")
        parent, child = (_attribute(element, end, "link") for end in ("parent", "child"))
        edges.append((joint, parent, child))
        values = {
            key: (part.attributes[key], part)
            for name, keys in _URDF_JOINT.items()
            for part in element.all(name)
            for key in keys
            if key in part.attributes
        }
        numbers = _check_joint(joint, values, fixed, negative_is_unlimited=False)
        if "effort" in numbers:
            facts.effort_limits[joint.name] = numbers["effort"]
        if numbers.get("friction", 0.0) > 0.0:
            facts.friction.append(joint.name)
        for mimic in element.all("mimic"):
            _refuse_mimic(joint, mimic.attributes.get("joint"), fixed, mimic)
            facts.mimics += 1
    _refuse_loops(edges, {})
    for transmission in model.root.all("transmission"):
        for actuator in transmission.all("actuator"):
            drive = _Part(model, actuator, "actuator")
            for key, allowed in _DRIVE.items():
                for part in actuator.all(key):
                    drive.number(key, part.attributes.get("value"), allowed, part)


def _inspect_sdf(model: ModelXml, facts: ModelFacts, fixed: frozenset[str]) -> None:
    for one in (element for element in model.root.within() if element.name == "model"):
        for element in one.all("link"):
            link = _Part(model, element, "link")
            inertial = element.first("inertial")
            if inertial is None:
                facts.without_inertia[link.name] = model.place(element)
                continue
            if inertial.attributes.get("auto", "").strip() in ("true", "1"):
                link.refuse("inertial auto", "true", "mass and inertia in numbers", inertial)
            inertia = inertial.first("inertia")
            moments = {} if inertia is None else {c.name: c.text for c in inertia.children}
            _check_inertia(link, _text(inertial, "mass"), moments, inertial)
        edges = []
        for element in one.all("joint"):
            joint = _Part(model, element, "joint")
            parent, child = ((_text(element, end) or "").strip() for end in ("parent", "child"))
            edges.append((joint, parent, child))
            values = {
                key: (part.text, part)
                for path, keys in _SDF_JOINT.items()
                for above in element.all(*path)
                for key in keys
                for part in above.all(key)
            }
            numbers = _check_joint(joint, values, fixed, negative_is_unlimited=True)
            if numbers.get("friction", 0.0) > 0.0:
                facts.friction.append(joint.name)
            if numbers.get("spring_stiffness", 0.0) > 0.0:
                facts.springs[joint.name] = numbers["spring_stiffness"]
            for key, allowed in _DRIVE.items():
                for part in element.all(key):
                    joint.number(key, part.text, allowed, part)
            for mimic in element.all("axis", "mimic"):
                _refuse_mimic(joint, mimic.attributes.get("joint"), fixed, mimic)
                facts.mimics += 1
        frames = {
            frame.attributes.get("name", ""): frame.attributes.get("attached_to", "")
            for frame in one.all("frame")
        }
        _refuse_loops(edges, frames)


def _inspect_mjcf(model: ModelXml, facts: ModelFacts, fixed: frozenset[str]) -> None:
    for element in (e for e in model.root.within() if e.name == "body"):
        body = _Part(model, element, "body")
        for inertial in element.all("inertial"):
            attributes = inertial.attributes
            moments = attributes.get("fullinertia") or attributes.get("diaginertia", "")
            named = dict(zip((*_MOMENTS, *_PRODUCTS), moments.split(), strict=False))
            _check_inertia(body, attributes.get("mass"), named, inertial)
        for element_of_joint in element.all("joint"):
            joint = _Part(model, element_of_joint, "joint")
            given = element_of_joint.attributes
            limits = dict(zip(("lower", "upper"), given.get("range", "").split(), strict=False))
            values = limits | {k: given[k] for k in ("damping", "armature") if k in given}
            _check_joint(
                joint, {key: (text, element_of_joint) for key, text in values.items()}, fixed, False
            )
    for equality in model.root.all("equality"):
        for constraint in equality.children:
            _Part(model, constraint, "equality").refuse(
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
_DRIVE = {"drake:rotor_inertia": _NOT_NEGATIVE, "drake:gear_ratio": _POSITIVE}
_JOINT_NUMBERS = {
    "lower": _LIMIT,
    "upper": _LIMIT,
    "effort": _NOT_NEGATIVE,
    "velocity": _NOT_NEGATIVE,
    "damping": _NOT_NEGATIVE,
    "friction": _NOT_NEGATIVE,
    "armature": _NOT_NEGATIVE,
    "spring_stiffness": _NOT_NEGATIVE,
    "spring_reference": _ANY,
}


def _text(element: Element, name: str) -> str | None:
    part = element.first(name)
    return None if part is None else part.text


def _attribute(element: Element, part_name: str, name: str) -> str | None:
    part = element.first(part_name)
    return None if part is None else part.attributes.get(name)


def _check_inertia(
    link: _Part, mass_text: str | None, inertia: dict[str, str], at: Element
) -> None:
    """Refuse a mass and an inertia about the centre of mass that no body has."""
    mass = link.number("mass", mass_text, _NOT_NEGATIVE, at)
    # for what is missing SDF takes 1 kg m^2
    needed = mass > 0.0 or link.model.root.name == "sdf"
    for key in _MOMENTS:
        if needed and key not in inertia:
            link.refuse(key, "missing", "moments of inertia with the mass", at)
    values = [link.number(key, inertia.get(key, "0"), _ANY, at) for key in (*_MOMENTS, *_PRODUCTS)]
    if mass == 0.0:
        if any(values):
            link.refuse("inertia", values, "zeros without mass; or a positive mass", at)
        return
    # Drake's own test, which has its tolerance; what fails there is replaced in silence
    I_C = np.array(values)[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
    principal = np.linalg.eigvalsh(I_C)
    physical = bool(principal[0] >= -1e-12 * principal[2])
    if not (physical and _acceptable_to_drake(values)):
        moments = ", ".join(f"{moment:.6g}" for moment in principal)
        link.refuse(
            "principal moments of inertia",
            f"[{moments}]",
            "none negative, none above the sum of the other two",
            at,
        )


def _acceptable_to_drake(values: list[float]) -> bool:
    try:
        return bool(RotationalInertia(*values).CouldBePhysicallyValid())
    except RuntimeError:
        return False


def _check_joint(
    joint: _Part,
    values: dict[str, tuple[str, Element]],
    fixed: frozenset[str],
    negative_is_unlimited: bool,
) -> dict[str, float]:
    """Return the numbers of a joint, or refuse them.

    Args:
        joint: The joint.
        values: What is written, and where, by key.
        fixed: Joints that will not move.
        negative_is_unlimited: Whether negative effort and velocity limits mean that there are
            none, as in SDF.
    """
    numbers = {}
    for key, (text, at) in values.items():
        allowed = _JOINT_NUMBERS[key]
        if key in ("effort", "velocity") and negative_is_unlimited:
            allowed = _LIMIT
        numbers[key] = joint.number(key, text, allowed, at)
    kind = joint.element.attributes.get("type", "hinge")
    if kind in _ONE_AXIS and "lower" in numbers and "upper" in numbers:
        lower, upper = numbers["lower"], numbers["upper"]
        stays = lower == upper and joint.name in fixed
        if not (lower < upper or stays):
            joint.refuse(
                "lower, upper",
                f"{lower:g}, {upper:g}",
                "lower below upper; a joint that stays is of type fixed or listed in fixed_joints",
                values["lower"][1],
            )
    return numbers


def _refuse_mimic(joint: _Part, leader: str | None, fixed: frozenset[str], at: Element) -> None:
    if joint.name not in fixed:
        joint.refuse("mimic", leader, "joints on their own; put it into fixed_joints", at)


def _refuse_loops(
    edges: Sequence[tuple[_Part, str | None, str | None]], frames: dict[str, str]
) -> None:
    """Refuse joints that lead back to where others already lead.

    Args:
        edges: Joints with the names of parent and child.
        frames: What each frame that is no link is attached to.
    """
    group: dict[str, str] = {}

    def link_of(name: str) -> str:
        for _ in frames:
            if not frames.get(name):
                break
            name = frames[name]
        return name

    def find(name: str) -> str:
        while group.get(name, name) != name:
            name = group[name]
        return name

    for joint, parent, child in edges:
        if not parent or not child:
            continue
        one, other = find(link_of(parent)), find(link_of(child))
        if one == other:
            joint.refuse(
                "child", f"'{child}'", "an open chain; this joint closes a loop", joint.element
            )
        group[other] = one
