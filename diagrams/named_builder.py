"""A builder in which the systems of a second robot have names of their own."""

from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System


class PrefixingBuilder(DiagramBuilder):
    """Adds systems to another builder, a prefix before their names.

    Args:
        builder: The builder that the systems stand in.
        prefix: What the names begin with.
    """

    def __init__(self, builder: DiagramBuilder, prefix: str) -> None:
        super().__init__()
        self._builder, self._prefix = builder, prefix

    def AddNamedSystem(self, name: str, system: System) -> System:
        """Add a system under its prefixed name, and return it."""
        return self._builder.AddNamedSystem(self._prefix + name, system)

    def Connect(self, output: OutputPort, input: InputPort) -> None:
        """Connect two ports of the other builder's systems."""
        self._builder.Connect(output, input)
