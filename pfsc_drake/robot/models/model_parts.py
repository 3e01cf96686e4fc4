"""Links and joints in a model file, and checks of their numbers."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import RotationalInertia

from pfsc_drake.checks import NUMBER
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.model_xml import Element, ModelXml

_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)
MOMENTS = ("ixx", "iyy", "izz")
PRODUCTS = ("ixy", "ixz", "iyz")
_ONE_AXIS = ("revolute", "prismatic", "hinge", "slide")

# far beyond any robot in any unit, and small enough to be squared and multiplied
LARGEST = 1e12

ANY, _LIMIT, _NOT_NEGATIVE, _POSITIVE = (
    f"a number of magnitude up to {LARGEST:g}",
    "a number",
    f"zero or a positive number up to {LARGEST:g}",
    f"a positive number up to {LARGEST:g}",
)
_NOT_SIGNED = "zero or a positive number"  # a limit of any size

DRIVE_NUMBERS = {"drake:rotor_inertia": _NOT_NEGATIVE, "drake:gear_ratio": _POSITIVE}
_JOINT_NUMBERS = {
    "lower": _LIMIT,
    "upper": _LIMIT,
    "effort": _NOT_SIGNED,
    "velocity": _NOT_SIGNED,
    "damping": _NOT_NEGATIVE,
    "friction": _NOT_NEGATIVE,
    "armature": _NOT_NEGATIVE,
    "spring_stiffness": _NOT_NEGATIVE,
    "spring_reference": ANY,
}


@dataclass(frozen=True)
class ModelPart:
    """A link, joint or drive in a model file.

    Attributes:
        model: The file.
        element: Its XML element.
        kind: Its kind, for messages.
    """

    model: ModelXml
    element: Element
    kind: str

    @property
    def name(self) -> str:
        """Its name."""
        return self.element.attributes.get("name", "")

    def number(self, key: str, text: str | None, allowed: str, at: Element | None = None) -> float:
        """Return a number.

        Args:
            key: Name of the number.
            text: The number's text; None if it is missing.
            allowed: Allowed numbers, one of the four constants of this module.
            at: Element that contains it, by default the part itself.

        Raises:
            InputError: If the text is no such number.
        """
        written = "" if text is None else text.strip()
        value = np.nan
        if NUMBER.fullmatch(written) or _INFINITE.fullmatch(written):
            value = float(written)
        valid = {
            ANY: abs(value) <= LARGEST,
            _LIMIT: not np.isnan(value),
            _NOT_NEGATIVE: 0.0 <= value <= LARGEST,
            _NOT_SIGNED: value >= 0.0 and np.isfinite(value),
            _POSITIVE: 0.0 < value <= LARGEST,
        }[allowed]
        if not valid:
            self.refuse(key, written or "empty", allowed, at)
        return value

    def check_numbers(self, key: str, text: str | None, at: Element) -> None:
        """Refuse a vector with a word that is not numeric; their count is not checked."""
        for word in (text or "").split():
            self.number(key, word, ANY, at)

    def refuse(self, key: str, value: object, allowed: str, at: Element | None = None) -> None:
        """Raise the InputError of a value; for the arguments see :meth:`number`."""
        shown = str(value) if len(str(value)) < 60 else f"{str(value)[:57]}..."
        raise InputError(
            f"{self.model.location(at or self.element)}: {self.kind} '{self.name}': "
            f"{key} = {shown}; allowed: {allowed}"
        )


def check_inertia(
    link: ModelPart, mass_text: str | None, inertia: dict[str, str], at: Element
) -> bool:
    """Refuse an unphysical mass and inertia about the centre of mass.

    Args:
        link: The link.
        mass_text: Text of its mass, None if it is missing.
        inertia: Texts of ``MOMENTS`` and ``PRODUCTS``, by key.
        at: The element that contains them.

    Returns:
        Whether moments of inertia are missing, for which SDF takes 1 kg m^2.

    Raises:
        InputError: If a number is invalid, a moment is missing or they are unphysical.
    """
    mass = link.number("mass", mass_text, _NOT_NEGATIVE, at)
    is_sdf = link.model.root.name == "sdf"
    missing = [key for key in MOMENTS if key not in inertia]
    if missing and (is_sdf == (mass == 0.0)):
        link.refuse(missing[0], "missing", "moments of inertia with the mass", at)
    written = dict.fromkeys(PRODUCTS, "0") | dict.fromkeys(MOMENTS, "1" if is_sdf else "0")
    written |= inertia
    values = [link.number(key, written[key], ANY, at) for key in (*MOMENTS, *PRODUCTS)]
    if mass == 0.0:
        if any(values):
            link.refuse("inertia", values, "zeros without mass; or a positive mass", at)
        return False
    # Drake's own test and tolerance; Drake silently replaces inertias that fail it
    I_C = np.array(values)[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
    principal = np.linalg.eigvalsh(I_C)
    physical = bool(principal[0] >= -1e-12 * principal[2])
    if not (physical and _acceptable_to_drake(values)):
        moments = ", ".join(f"{moment:.9g}" for moment in principal)
        link.refuse(
            "principal moments of inertia",
            f"[{moments}]",
            "none negative, none above the sum of the other two",
            at,
        )
    return bool(missing)


def _acceptable_to_drake(values: list[float]) -> bool:
    try:
        return bool(RotationalInertia(*values).CouldBePhysicallyValid())
    except RuntimeError:
        return False


def check_joint(
    joint: ModelPart, values: dict[str, tuple[str, Element]], fixed: frozenset[str]
) -> dict[str, float]:
    """Return the numbers of a joint, or refuse them.

    Args:
        joint: The joint.
        values: Texts and their elements, by key.
        fixed: Joints that will not move.

    Raises:
        InputError: If a number is invalid or out of range, or the lower limit is not below the
            upper one.
    """
    numbers = {}
    for key, (text, at) in values.items():
        allowed = _JOINT_NUMBERS[key]
        if key in ("effort", "velocity") and joint.model.root.name == "sdf":
            allowed = _LIMIT  # negative for none
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


def refuse_loops(
    edges: Sequence[tuple[ModelPart, str | None, str | None]], frames: dict[str, str]
) -> None:
    """Refuse joints that close a loop.

    Args:
        edges: Joints with the names of parent and child.
        frames: Link or frame that each frame is attached to.
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


@dataclass(frozen=True)
class Mimic:
    """A joint at ``multiplier * leader + offset``.

    Attributes:
        leader: Name of the joint that it follows.
        multiplier: Factor of the leader's position.
        offset: Its position when the leader is at zero [rad or m].
        location: File and line of the definition, for messages.
    """

    leader: str
    multiplier: float
    offset: float
    location: str


def mimic_elements(model: ModelXml) -> Iterator[tuple[Element, Element]]:
    """Iterate over joints of a URDF or SDF model that follow others, with their mimic elements."""
    path = {"robot": ("mimic",), "sdf": ("axis", "mimic")}.get(model.root.name)
    if path is None:
        return
    for joint in (element for element in model.root.within() if element.name == "joint"):
        for mimic in joint.all(*path):
            yield joint, mimic


def mimics_of(model: ModelXml) -> dict[str, Mimic]:
    """Return the joints of a model that follow others, by name.

    Args:
        model: URDF, SDF or MJCF; in the last they are equality constraints of two joints, of which
            the constant and the linear part count.

    Raises:
        InputError: If a number is invalid.
    """
    found = {}
    for element, mimic in mimic_elements(model):
        joint = ModelPart(model, element, "joint")
        entries = mimic.attributes | {child.name: child.text for child in mimic.children}
        number = {
            key: joint.number(f"mimic {key}", entries.get(key, usual), ANY, mimic)
            for key, usual in {"multiplier": "1", "offset": "0", "reference": "0"}.items()
        }
        found[joint.name] = Mimic(
            entries.get("joint", ""),
            number["multiplier"],
            number["offset"] - number["multiplier"] * number["reference"],
            model.location(element),
        )
    for element in model.root.all("equality", "joint"):
        attributes = element.attributes
        if "joint1" not in attributes or "joint2" not in attributes:
            continue
        part = ModelPart(model, element, "equality")
        words = attributes.get("polycoef", "0 1").split()
        offset, slope = (
            part.number("polycoef", word, ANY) for word in (words + ["0", "1"][len(words) :])[:2]
        )
        found[attributes["joint1"]] = Mimic(
            attributes["joint2"], slope, offset, model.location(element)
        )
    return found
