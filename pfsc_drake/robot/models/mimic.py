"""Joints that follow other joints, such as the second finger of a gripper: fixed where these are.

A chain of joints has none that moves with another. Those of a gripper are fixed anyway: whoever
fixes the leader fixes what follows it, where it then stands.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.model_parts import ANY, ModelPart
from pfsc_drake.robot.models.model_xml import Element, ModelXml


@dataclass(frozen=True)
class Mimic:
    """A joint at ``multiplier * leader + offset``.

    Attributes:
        leader: Name of the joint that it follows.
        multiplier: Of the leader's position.
        offset: Where it stands when the leader is at zero [rad or m].
        place: Where the model says so, for messages.
    """

    leader: str
    multiplier: float
    offset: float
    place: str


def mimic_elements(model: ModelXml) -> Iterator[tuple[Element, Element]]:
    """Yield the joints of a URDF or SDF model that follow others, and the elements that say so."""
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
        InputError: If a number is none.
    """
    found = {}
    for element, mimic in mimic_elements(model):
        joint = ModelPart(model, element, "joint")
        said = mimic.attributes | {child.name: child.text for child in mimic.children}
        number = {
            key: joint.number(f"mimic {key}", said.get(key, usual), ANY, mimic)
            for key, usual in {"multiplier": "1", "offset": "0", "reference": "0"}.items()
        }
        found[joint.name] = Mimic(
            said.get("joint", ""),
            number["multiplier"],
            number["offset"] - number["multiplier"] * number["reference"],
            model.place(element),
        )
    for element in model.root.all("equality", "joint"):
        given = element.attributes
        if "joint1" not in given or "joint2" not in given:
            continue
        part = ModelPart(model, element, "equality")
        words = given.get("polycoef", "0 1").split()
        offset, slope = (
            part.number("polycoef", word, ANY) for word in (words + ["0", "1"][len(words) :])[:2]
        )
        found[given["joint1"]] = Mimic(given["joint2"], slope, offset, model.place(element))
    return found


def with_followers(
    mimics: Mapping[str, Mimic], fixed: Mapping[str, float], still: Collection[str] = ()
) -> dict[str, float]:
    """Return the positions of fixed joints, and of what follows them.

    Args:
        mimics: See :func:`mimics_of`.
        fixed: Positions of joints that are fixed, by name [rad or m]; those of followers, too, are
            taken as they are given.
        still: Joints that cannot move, whose position is zero.

    Raises:
        InputError: If a joint follows one that moves, or itself.
    """
    positions = dict(fixed)

    def position(name: str, waiting: tuple[str, ...]) -> float:
        if name in positions:
            return positions[name]
        if name in still:
            return 0.0
        mimic = mimics.get(name)
        if mimic is None or name in waiting:
            follower = waiting[0]
            raise InputError(
                f"{mimics[follower].place}: joint '{follower}': mimic = {mimics[follower].leader}, "
                "which moves; allowed: joints on their own: fix the one that it follows, and it is "
                f"fixed too: fixed_joints: {{{name}: VALUE}}"
            )
        return mimic.multiplier * position(mimic.leader, (*waiting, name)) + mimic.offset

    for name in mimics.keys() - set(still):
        positions[name] = position(name, ())
    return positions
