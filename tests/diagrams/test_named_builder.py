"""Systems of two robots in one builder, under names of their own."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain

from diagrams.named_builder import PrefixingBuilder


def test_names_begin_with_the_prefix_and_ports_are_connected():
    builder = DiagramBuilder()
    named = PrefixingBuilder(builder, "other_")
    builder.AddNamedSystem("source", ConstantVectorSource([1.0]))
    source = named.AddNamedSystem("source", ConstantVectorSource([2.0]))
    gain = named.AddNamedSystem("gain", Gain(3.0, 1))
    named.Connect(source.get_output_port(), gain.get_input_port())
    diagram = builder.Build()
    names = [system.get_name() for system in diagram.GetSystems()]
    assert names == ["source", "other_source", "other_gain"]
    context = gain.GetMyContextFromRoot(diagram.CreateDefaultContext())
    assert np.array_equal(gain.get_output_port().Eval(context), [6.0])
