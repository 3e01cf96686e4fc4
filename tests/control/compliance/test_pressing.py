"""A force reference among forces."""

import casadi as ca
import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.blocks.cases import where
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.impedance import ImpedanceLaw
from pfsc_drake.control.compliance.impedance_filter import ImpedanceFilter
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.compliance.pressing import Pressing, PressParameters
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.systems.block_system import BlockSystem

PERIOD = 1e-3


def _force(time, touch_down, lifted):
    return where(touch_down < ca.inf, 100.0 + touch_down, 2.0 * time)


def test_it_acts_against_its_coordinate():
    stepper = Stepper(Pressing(_force, 1e3, 2, 5, 5, PERIOD))
    stepper.tick = 1500
    out = stepper.step(manifold_force=np.arange(5.0), reference=np.zeros(5), ready=0.0)
    np.testing.assert_allclose(out["pressed_force"], [0.0, 1.0, -1.0, 3.0, 4.0])
    assert out["press"] == [3.0]


def test_it_stores_the_time_of_touch_down():
    """Not before the sensor is tared, once, and for good."""
    stepper = Stepper(Pressing(_force, 3.0, 0, 1, 1, PERIOD))
    samples = [(50.0, 0.0)] * 11 + [(2.9, 1.0)] * 10 + [(3.0, 1.0)] * 10 + [(0.0, 1.0)] * 20
    press = [
        stepper.step(manifold_force=force, reference=0.0, ready=ready)["press"][0]
        for force, ready in samples
    ]
    time = PERIOD * np.arange(len(samples))
    np.testing.assert_allclose(press[:22], 2.0 * time[:22])
    np.testing.assert_allclose(press[22:], 100.0 + 21 * PERIOD)


def test_the_reference_needs_no_force():
    program = Program(Network.of(Pressing(_force, 3.0, 0, 1, 1, PERIOD)))
    needs = program.stages[program.output("press")[0]].needs
    assert "manifold_force" not in {source.name for source in needs}


@pytest.mark.parametrize(("measured", "lost"), [(-14.9, 0), (-15.1, 1), (24.9, 0), (25.1, 1)])
def test_a_force_far_from_its_reference_is_lost(measured, lost):
    """The reference is 5 N; there is no alarm before the sensor is tared."""
    block = Pressing(lambda time, touch_down, lifted: ca.DM(5.0), 3.0, 1, 2, 2, PERIOD, 20.0)
    inputs = {"manifold_force": [1e3, measured], "reference": np.zeros(2)}
    assert Stepper(block).step(**inputs, ready=1.0)["lost"] == [lost]
    assert Stepper(block).step(**inputs, ready=0.0)["lost"] == [0.0]


@pytest.mark.slow(but="0.5")
@pytest.mark.parametrize("left", [-0.5, 0.0, 0.5])
def test_a_tool_stays_at_its_clearance(left):
    """Moved by its filter alone for a long time, with a residual bias of the sensor."""
    mass, damping, end, clearance = 6.0, 500.0, 1.0, 0.01
    press = PressParameters(force=0.0, approach=0.0, retreat=10.0, clearance=clearance, limit=15.0)
    across = CoordinateImpedance(Profile(mass), Profile(damping), Profile(0.0))
    coordinates = SurfaceManifold(2).coordinates
    law = ImpedanceLaw(ImpedanceParameters(transversal=across), coordinates, 2, PERIOD)
    builder = DiagramBuilder()
    impedance = builder.AddSystem(BlockSystem(ImpedanceFilter(law), PERIOD))
    reference = impedance.GetOutputPort("reference")
    block = Pressing(
        press.over_time(end, damping**2 / (4.0 * mass)),
        press.touching,
        2,
        3,
        reference.size(),
        PERIOD,
        off=press.retreat_begin(end),
    )
    pressing = builder.AddSystem(BlockSystem(block, PERIOD))
    builder.Connect(reference, pressing.GetInputPort("reference"))
    builder.Connect(
        pressing.GetOutputPort("pressed_force"), impedance.GetInputPort("manifold_force")
    )
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    inputs = (("desired_reference", np.zeros(9)), ("manifold_state", np.zeros(6)))
    for name, value in inputs:
        impedance.GetInputPort(name).FixValue(impedance.GetMyMutableContextFromRoot(root), value)
    context = pressing.GetMyMutableContextFromRoot(root)
    pressing.GetInputPort("manifold_force").FixValue(context, [0.0, 0.0, left])
    pressing.GetInputPort("ready").FixValue(context, [1.0])

    def position():
        return reference.Eval(impedance.GetMyContextFromRoot(root))[2]

    simulator.AdvanceTo(press.retreat_begin(end))
    before = position()
    assert before == pytest.approx(left * press.retreat_begin(end) / damping, abs=2e-5)
    highest = 0.0
    while root.get_time() < 5.0:
        simulator.AdvanceTo(root.get_time() + 0.02)
        highest = max(highest, position())
    spring = 2.0 * press.retreat / clearance
    assert position() - before == pytest.approx(clearance + left / spring, abs=1e-5)
    assert highest <= position() + 1e-6, "it does not swing"
