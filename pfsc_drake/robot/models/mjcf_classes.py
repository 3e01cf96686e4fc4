"""Default classes of an MJCF model, and the attributes inherited from them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Self

from pfsc_drake.robot.models.model_xml import Element, ModelXml

# shortcuts of actuators, which share one set of defaults in a class
ACTUATORS = {
    *("general", "motor", "position", "velocity", "intvelocity"),
    *("damper", "cylinder", "muscle", "adhesion", "dcmotor"),
}
MAIN = "main"

Attributes = dict[str, str]


@dataclass
class DefaultClasses:
    """Attributes of default classes, by class and kind of element."""

    known: dict[str, dict[str, Attributes]] = field(default_factory=dict)

    @classmethod
    def of(cls, models: list[ModelXml]) -> Self:
        """Return the classes of a model.

        Args:
            models: The model and what it includes.
        """
        classes = cls()
        for root in (model.root for model in models if model.root.name.startswith("mujoco")):
            for default in root.all("default"):
                classes.read(default)
        return classes

    def read(self, default: Element, above: str | None = None) -> None:
        """Add a class and those in it."""
        name = default.attributes.get("class", MAIN)
        inherited = {} if above is None else self.known[above]
        own = self.known.setdefault(
            name, {kind: dict(attributes) for kind, attributes in inherited.items()}
        )
        for element in default.children:
            if element.name != "default":
                kind = "actuator" if element.name in ACTUATORS else element.name
                own.setdefault(kind, {}).update(element.attributes | servo_attributes(element))
        for element in default.all("default"):
            self.read(element, name)

    def resolve(self, element: Element, kind: str, inherited: str = MAIN) -> Attributes:
        """Return the attributes of an element with those of its class."""
        name = element.attributes.get("class", inherited)
        return self.known.get(name, {}).get(kind, {}) | element.attributes

    def below(
        self, body: Element, kind: str, inherited: str = MAIN
    ) -> Iterator[tuple[Element, Element, Attributes]]:
        """Iterate over the elements of a kind in a body and the bodies below it.

        Args:
            body: The body, or the world's.
            kind: Tag of the elements.
            inherited: Class of elements without one, unless the body has another one.

        Yields:
            Their body, the element, and its attributes with those of its class.
        """
        inherited = body.attributes.get("childclass", inherited)
        for element in body.all(kind):
            yield body, element, self.resolve(element, kind, inherited)
        for child in body.all("body"):
            yield from self.below(child, kind, inherited)


def servo_attributes(element: Element) -> Attributes:
    """Return gain and bias of a shortcut as attributes of a general actuator."""
    if element.name == "motor":
        return {"biastype": "none", "gainprm": "1"}
    if element.name in ACTUATORS - {"general"}:
        return {"biastype": "affine"}
    return {}
