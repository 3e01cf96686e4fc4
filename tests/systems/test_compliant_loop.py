"""Compliance in closed loops: with forces that depend on where it goes, and with a robot."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    MatrixGain,
    ZeroOrderHold,
)
from scipy.spatial.transform import Rotation

from pfsc_drake.control.compliance.impedance import ImpedanceLaw
from pfsc_drake.control.compliance.impedance_filter import ImpedanceFilter, ManifoldForceTransform
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.manifolds.manifold import Projector, ToolKinematics
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import (
    Path,
    interpolate_orientation,
    quaternion_to_matrix,
    zyx_to_quaternion,
)
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

PERIOD = 1e-3


def soft():
    """Return a law with the values of Tab. 3.2, but another damping far from the path."""
    damping = Profile(over="xi", at=[0.0, 0.02], values=[122.47, 60.0])
    tangential = CoordinateImpedance(Profile(0.3), Profile(300.0), Profile(3000.0))
    transversal = CoordinateImpedance(Profile(0.3), damping, Profile(500.0))
    parameters = ImpedanceParameters(tangential, transversal)
    return ImpedanceLaw(parameters, PathManifold(2, oriented=False).coordinates, 2, PERIOD)


def test_the_rotational_forces_may_depend_on_the_reference(path):
    """phi_pd of (3.44) is the filter's own output; that is no algebraic loop.

    It comes to rest where springs and torque do no work together in any turn.
    """
    stiffness, moment, manifold = 20.0, np.array([3.0, -5.0, 4.0]), PathManifold(2, oriented=True)
    angle = CoordinateImpedance(Profile(0.1), Profile(4.0), Profile(stiffness))
    parameters = ImpedanceParameters(angle, angle, angle)
    law = ImpedanceLaw(parameters, manifold.coordinates, 2, PERIOD)
    quaternions = zyx_to_quaternion(np.array([[0.4, -0.2, 0.7]]))
    theta = np.array([0.0, 2.0 * np.pi])
    turned = interpolate_orientation(quaternions, theta, smoothness=3, closed=True)
    point = Path(path.position, turned).evaluator(2)([0.9, 0.2, 1.1], 0.6)
    R_d = Rotation.from_matrix(quaternion_to_matrix(point[manifold.layout.quaternion][:4]))
    builder = DiagramBuilder()
    system = builder.AddSystem(BlockSystem(ImpedanceFilter(law), PERIOD))
    transform = builder.AddSystem(BlockSystem(ManifoldForceTransform(manifold), PERIOD))
    builder.Connect(system.GetOutputPort("reference"), transform.GetInputPort("reference"))
    builder.Connect(transform.get_output_port(), system.GetInputPort("manifold_force"))
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    inside = system.GetMyMutableContextFromRoot(root)
    for name in ("desired_reference", "manifold_state"):
        port = system.GetInputPort(name)
        port.FixValue(inside, np.zeros(port.size()))
    inside = transform.GetMyMutableContextFromRoot(root)
    transform.GetInputPort("wrench").FixValue(inside, [0.0, 0.0, 0.0, *moment])
    transform.GetInputPort("manifold_point").FixValue(inside, point)
    simulator.AdvanceTo(3.0)
    output = system.GetOutputPort("reference").Eval(system.GetMyContextFromRoot(root))
    phi = output.ravel()[3:6]
    assert np.abs(phi).min() > 0.05

    def turn(angles):
        return R_d * Rotation.from_euler("ZYX", angles)

    for i, step in enumerate(1e-6 * np.eye(3)):
        rotation = (turn(phi + step) * turn(phi - step).inv()).as_rotvec()
        assert stiffness * phi[i] * 2e-6 == pytest.approx(moment @ rotation, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["reference", "actual"])
def test_a_robot_yields_to_a_force(arm, path, request, start):
    """In the intended wiring, with a constant measured force: the deflection is f / k."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
    plant.Finalize()
    chain, coordinates = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    theta, force = 0.6, np.array([3.0, -4.0, 5.0, 0.0, 0.0, 0.0])
    desired = np.array([path.arc_length(theta), *np.zeros(8)])
    controller = FollowingController(request.getfixturevalue("make_law")(), PERIOD)
    rows = np.vstack([coordinates.link_rows, coordinates.motor_rows])
    parts = {
        "measured": builder.AddSystem(MatrixGain(rows)),
        "kinematics": builder.AddSystem(BlockSystem(ToolKinematics(chain), PERIOD)),
        "projector": builder.AddSystem(BlockSystem(Projector(path.evaluator(2)), PERIOD)),
        "controller": builder.AddSystem(controller),
        "filter": builder.AddSystem(BlockSystem(ImpedanceFilter(soft(), start=start), PERIOD)),
        "transform": builder.AddSystem(
            BlockSystem(ManifoldForceTransform(PathManifold(2, oriented=False)), PERIOD)
        ),
        "desired": builder.AddSystem(ConstantVectorSource(desired)),
        "wrench": builder.AddSystem(ConstantVectorSource(force)),
        "hold": builder.AddSystem(ZeroOrderHold(PERIOD, 3)),
    }
    builder.Connect(plant.get_state_output_port(), parts["measured"].get_input_port())
    builder.Connect(parts["hold"].get_output_port(), plant.get_actuation_input_port())
    for source, sink in (
        ("measured", "kinematics.joint_state"),
        ("measured", "controller.joint_state"),
        ("kinematics", "projector.tool_pose"),
        ("projector", "controller.manifold_point"),
        ("projector", "transform.manifold_point"),
        ("wrench", "transform.wrench"),
        ("desired", "filter.desired_reference"),
        ("transform", "filter.manifold_force"),
        ("controller.manifold_state", "filter.manifold_state"),
        ("filter.reference", "controller.reference"),
        ("controller.drive_torque", "hold"),
    ):
        (a, _, output), (b, _, name) = source.partition("."), sink.partition(".")
        begin = parts[a].GetOutputPort(output) if output else parts[a].get_output_port()
        end = parts[b].GetInputPort(name) if name else parts[b].get_input_port()
        builder.Connect(begin, end)
    context = (diagram := builder.Build()).CreateDefaultContext()
    q = arm.reach(path.position.derivatives(theta, 0)[0] + np.array([0.004, -0.006, 0.005]))
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), q)
    Simulator(diagram, context).AdvanceTo(1.5)

    def output(part, name):
        system = parts[part]
        return system.GetOutputPort(name).Eval(system.GetMyContextFromRoot(context))

    reference, yhat = output("filter", "reference"), output("controller", "manifold_state")
    tau = output("transform", "manifold_force")
    expected = desired[:3] + tau / [3000.0, 500.0, 500.0]
    assert np.allclose(reference[:3], expected, rtol=0, atol=2e-5)
    assert np.allclose(yhat[:3], reference[:3], rtol=0, atol=2e-5)
    assert output("controller", "status")[0] == 0.0
