"""A force reference among forces."""

import numpy as np

from pfsc_drake.systems.control.pressing import Pressing


def test_it_acts_against_its_coordinate():
    system = Pressing(lambda time: 2.0 * time, coordinate=2, num_outputs=5)
    context = system.CreateDefaultContext()
    force = np.arange(5.0)
    system.GetInputPort("manifold_force").FixValue(context, force)
    context.SetTime(1.5)
    pressed = system.GetOutputPort("pressed_force").Eval(context)
    np.testing.assert_allclose(pressed, [0.0, 1.0, -1.0, 3.0, 4.0])
    assert system.GetOutputPort("press").Eval(context) == [3.0]


def test_the_reference_needs_no_force():
    system = Pressing(lambda _: 20.0, coordinate=0, num_outputs=1)
    assert not system.HasDirectFeedthrough(0, system.GetOutputPort("press").get_index())
