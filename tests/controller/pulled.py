"""A robot as Drake alone knows it, that a hand pulls at its tool."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator


class Pulled:
    """A plant and its controller, with a force at the tool that one sets.

    Args:
        builder: Builder of the diagram, with
        plant: the plant, and
        follower: the controller in it, neither connected.
        tool: Name of the tool frame.
    """

    def __init__(self, builder, plant, follower, tool="tool_point"):
        self.plant, self.follower, self._tool = plant, follower, plant.GetFrameByName(tool)
        builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
        builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
        builder.ExportInput(follower.GetInputPort("wrench"), "wrench")
        builder.ExportInput(plant.get_applied_spatial_force_input_port(), "applied")
        diagram = builder.Build()
        self._ports = [diagram.GetInputPort(name) for name in ("wrench", "applied")]
        self._simulator = Simulator(diagram)
        self.root = self._simulator.get_mutable_context()
        self.context = plant.GetMyMutableContextFromRoot(self.root)
        plant.SetPositionsAndVelocities(self.context, follower.start_state)
        self.pull(np.zeros(3))

    def pull(self, force, felt=None):
        """Set the force that is measured [N], world axes, and the one that the plant feels."""
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self._tool.body().index()
        applied.p_BoBq_B = self._tool.GetFixedPoseInBodyFrame().translation()
        applied.F_Bq_W = SpatialForce(tau=np.zeros(3), f=force if felt is None else felt)
        self._ports[0].FixValue(self.root, np.concatenate([force, np.zeros(3)]))
        self._ports[1].FixValue(self.root, Value([applied]))

    def run(self, time):
        """Simulate until a time [s]."""
        self._simulator.AdvanceTo(time)

    def pose(self):
        """Return the pose of the tool in the world."""
        return self._tool.CalcPoseInWorld(self.context)

    def state(self):
        """Return the state of the plant."""
        return self.plant.GetPositionsAndVelocities(self.context)

    def read(self, port):
        """Return an output of the controller."""
        own = self.follower.GetMyContextFromRoot(self.root)
        return self.follower.GetOutputPort(port).Eval(own)

    def fault(self):
        """Return the fault, if there is one."""
        return self.read("fault")[0]
