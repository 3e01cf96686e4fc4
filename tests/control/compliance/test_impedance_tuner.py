"""The tuner beside a filter, as in a station."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, VectorLogSink

from pfsc_drake.control.compliance.impedance import STIFFNESS, ImpedanceLaw
from pfsc_drake.control.compliance.impedance_filter import ImpedanceFilter
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.compliance.tuned_impedance import ImpedanceTuner, TuningParameters
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.systems.block_system import BlockSystem

PERIOD = 1e-3
COORDINATES = PathManifold(2, oriented=False).coordinates


@pytest.fixture
def station():
    """A filter that is pulled with 30 N across, and its tuner."""
    soft = CoordinateImpedance(Profile(3.0), Profile(150.0), Profile(1000.0))
    law = ImpedanceLaw(ImpedanceParameters(transversal=soft), COORDINATES, 2, PERIOD)
    tuning = ImpedanceTuner(TuningParameters(), law, COORDINATES, np.full(3, 3.0))
    builder = DiagramBuilder()
    impedance = builder.AddSystem(BlockSystem(ImpedanceFilter(law), PERIOD))
    tuner = builder.AddSystem(BlockSystem(tuning, PERIOD))
    constants = {
        "desired_reference": np.zeros(9),
        "manifold_state": np.zeros(6),
        "manifold_force": [0.0, 30.0, 0.0],
    }
    for name, value in constants.items():
        source = builder.AddSystem(ConstantVectorSource(np.asarray(value, dtype=float)))
        for system in (impedance, tuner):
            if system.HasInputPort(name):
                builder.Connect(source.get_output_port(), system.GetInputPort(name))
    builder.Connect(impedance.GetOutputPort("reference"), tuner.GetInputPort("reference"))
    builder.Connect(tuner.GetOutputPort("impedance"), impedance.GetInputPort("impedance"))
    log = builder.AddSystem(VectorLogSink(9, PERIOD))
    builder.Connect(impedance.GetOutputPort("reference"), log.get_input_port())
    diagram = builder.Build()
    return Simulator(diagram), tuner, log


@pytest.mark.slow
def test_stiffness_changes_at_depth_without_a_jump_to_the_request(station):
    simulator, tuner, log = station
    root = simulator.get_mutable_context()
    request = tuner.GetInputPort("request")
    context = tuner.GetMyMutableContextFromRoot(root)
    request.FixValue(context, np.full(6, -1.0))
    simulator.AdvanceTo(1.5)
    request.FixValue(context, [-1.0, -1.0, 3000.0, -1.0, -1.0, -1.0])
    simulator.AdvanceTo(6.0)
    motion = log.FindLog(root).data()
    xi, rate = motion[1], motion[4]
    assert xi[1500] == pytest.approx(0.03, rel=1e-3)
    assert xi[-1] == pytest.approx(0.01, rel=1e-3)
    # what a spring of 3,000 N/m at 30 mm does to 3 kg in a tick, and no more
    assert np.abs(np.diff(rate)).max() < 90.0 / 3.0 * PERIOD
    assert np.abs(np.diff(xi)).max() < 1.1 * PERIOD * np.abs(rate).max()
    assert tuner.GetOutputPort("tank").Eval(context)[0] >= 0.0


def test_along_a_rigid_coordinate_nothing_changes(station):
    simulator, tuner, log = station
    root = simulator.get_mutable_context()
    context = tuner.GetMyMutableContextFromRoot(root)
    tuner.GetInputPort("request").FixValue(context, np.full(6, -1.0))
    simulator.AdvanceTo(0.2)
    assert not log.FindLog(root).data()[0].any()
    impedance = tuner.GetOutputPort("impedance").Eval(context).reshape(3, 3)
    assert impedance[STIFFNESS].tolist() == [np.inf, 1000.0, 1000.0]
