"""What of sensor and compliance stops a robot, in the order of the port that is told."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from pfsc_drake.following.controller import _connect_alarms

ALARMS = {"sensor_fault": 1.0, "tared": 2.0, "compliance_status": 3.0, "press_lost": 4.0}


@pytest.mark.parametrize("known", [list(ALARMS), ["tared", "sensor_fault"], ["compliance_status"]])
def test_alarms_come_in_their_order(known):
    """What nobody tells is zero; what compliance tells is no signal of the log."""
    builder = DiagramBuilder()
    told = builder.AddSystem(PassThrough(4))
    builder.ExportOutput(told.get_output_port(), "told")
    controller = SimpleNamespace(period=1e-3, GetInputPort={"alarms": told.get_input_port()}.get)
    sources = {
        name: builder.AddSystem(ConstantVectorSource([ALARMS[name]])).get_output_port()
        for name in known
    }
    ports = {name: sources[name] for name in ("sensor_fault", "tared") if name in sources}
    made = {name: port for name, port in sources.items() if name not in ports}
    made["reference"] = None
    _connect_alarms(builder, controller, ports, made)
    assert list(made) == ["reference"]
    diagram = builder.Build()
    found = diagram.GetOutputPort("told").Eval(diagram.CreateDefaultContext())
    np.testing.assert_array_equal(found, [v * (name in known) for name, v in ALARMS.items()])
