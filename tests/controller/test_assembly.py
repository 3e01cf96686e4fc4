"""Alarms of sensor and compliance, in the order of the port for them."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from pfsc_drake.controller.assembly import Assembly

ALARMS = {"sensor_fault": 1.0, "tared": 2.0, "compliance_status": 3.0, "press_lost": 4.0}


@pytest.mark.parametrize("known", [list(ALARMS), ["tared", "sensor_fault"], ["compliance_status"]])
def test_alarms_come_in_their_order(known):
    """Alarms without a source are zero."""
    builder = DiagramBuilder()
    told = builder.AddSystem(PassThrough(4))
    builder.ExportOutput(told.get_output_port(), "told")
    controller = SimpleNamespace(period=1e-3, GetInputPort={"alarms": told.get_input_port()}.get)
    sources = {
        name: builder.AddSystem(ConstantVectorSource([ALARMS[name]])).get_output_port()
        for name in known
    }
    assembly = object.__new__(Assembly)
    assembly.builder, assembly.period, assembly.controller = builder, 1e-3, controller
    assembly._connect_alarms(sources)
    diagram = builder.Build()
    found = diagram.GetOutputPort("told").Eval(diagram.CreateDefaultContext())
    np.testing.assert_array_equal(found, [v * (name in known) for name, v in ALARMS.items()])
