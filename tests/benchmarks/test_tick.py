"""Time of one controller tick as runs have it, from the plant's state to the drive torques.

The joints are supervised, and between two ticks everything is remembered that a run remembers.

Run with ``pytest tests/benchmarks --benchmark-enable``; otherwise every benchmark runs once.
"""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain
from scipy.optimize import least_squares

from pfsc_drake.control.estimation.momentum import (
    MomentumObserver,
    drive_momentum,
    link_momentum,
)
from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.law.reference import SmoothStart, rest_to_rest
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.manifold import Projector, ToolKinematics
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import (
    FourierCurve,
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
THETA = 0.7
COUNT = 64
NAMES = ["eta", "xi_1", "xi_2", "phi_1", "phi_2", "phi_3"]
CASES = {
    "6R elastic oriented": ("comau_racer_1_4_elastic", "elastic", True, False),
    "6R elastic oriented with all": ("comau_racer_1_4_elastic", "elastic", True, True),
    "3R elastic": ("comau_racer_1_4_elastic_3r", "elastic", False, False),
    "6R rigid oriented": ("comau_racer_1_4", "rigid", True, False),
}


class Chain:
    """The controller's chain of systems, and the plant's states of successive ticks.

    ``with_all``: with observers of friction and of external torques, and a smooth start.
    """

    def __init__(self, model, law, oriented, with_all):
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(resolve_model(model)))
        plant.Finalize()
        tool = plant.GetFrameByName("tool_point")
        self.robot, self.coordinates = chain_from_plant(plant, tool)
        self.path = make_path(oriented)
        self.law = make_law(self.robot, law, oriented)
        self.states = self._states(plant, tool)
        self._build(with_all)

    def _states(self, plant, tool):
        """States along the path at 1.5 m/s, each a tick after the one before."""
        context, n = plant.CreateDefaultContext(), self.robot.dimension

        def plant_state(q, v):
            return self.coordinates.plant_state(np.concatenate([q, v, q, v]))

        def error(q, theta):
            plant.SetPositionsAndVelocities(context, plant_state(q, np.zeros(n)))
            X_WT = tool.CalcPoseInWorld(context)
            y = X_WT.translation() - self.path.position.derivatives(theta, 0)[0] - 0.002
            if self.path.orientation is None:
                return y
            R_d = quaternion_to_matrix(self.path.orientation.derivatives(theta, 0)[0])
            return np.concatenate([y, (X_WT.rotation().matrix() - R_d).ravel()])

        q = np.array([0.2, 1.6, -0.5, 0.1, 1.2, 0.1])[:n]
        speed = np.linalg.norm(self.path.position.derivatives(THETA, 1)[1])
        motion = []
        for theta in THETA + 1.5 * PERIOD / speed * np.arange(COUNT):
            q = least_squares(error, q, args=(theta,)).x
            motion.append(q)
        velocities = np.gradient(motion, PERIOD, axis=0)
        return [plant_state(q, v) for q, v in zip(motion, velocities, strict=True)]

    def _build(self, with_all):
        r, m = self.law.linearization.relative_degree, self.law.linearization.num_outputs
        builder = DiagramBuilder()
        rows = np.vstack([self.coordinates.link_rows, self.coordinates.motor_rows])
        measured = builder.AddSystem(MatrixGain(rows))
        kinematics = builder.AddSystem(BlockSystem(ToolKinematics(self.robot), PERIOD))
        projector = builder.AddSystem(BlockSystem(Projector(self.path.evaluator(r)), PERIOD))
        controller = builder.AddSystem(
            FollowingController(self.law, PERIOD, SupervisionParameters())
        )
        motion = rest_to_rest([0.0, 5.0], velocity=1.5, acceleration=5.0)
        reference = builder.AddSystem(BlockSystem(TimedReference(motion, r, m, PERIOD), PERIOD))
        builder.ExportInput(measured.get_input_port(), "plant_state")
        builder.Connect(measured.get_output_port(), kinematics.GetInputPort("joint_state"))
        builder.Connect(measured.get_output_port(), controller.GetInputPort("joint_state"))
        builder.Connect(kinematics.get_output_port(), projector.GetInputPort("tool_pose"))
        builder.Connect(projector.get_output_port(), controller.GetInputPort("manifold_point"))
        wanted = reference.get_output_port()
        if with_all:
            start = builder.AddSystem(BlockSystem(SmoothStart(0.03, r, m, r * m, PERIOD), PERIOD))
            actual = controller.GetOutputPort("manifold_state")
            builder.Connect(wanted, start.GetInputPort("desired_reference"))
            builder.Connect(actual, start.GetInputPort("manifold_state"))
            wanted = start.GetOutputPort("reference")
        builder.Connect(wanted, controller.GetInputPort("reference"))
        builder.ExportOutput(controller.GetOutputPort("drive_torque"), "drive")
        if with_all:
            friction = MomentumObserver(drive_momentum(self.robot), 300.0, PERIOD)
            forces = MomentumObserver(link_momentum(self.robot), 100.0, PERIOD, r - 2)
            for observer, port in ((friction, "friction_torque"), (forces, "tau_ext")):
                system = builder.AddSystem(BlockSystem(observer, PERIOD))
                for name, source in (
                    ("joint_state", measured.get_output_port()),
                    ("drive_torque", controller.GetOutputPort("drive_torque")),
                ):
                    builder.Connect(source, system.GetInputPort(name))
                builder.Connect(system.get_output_port(), controller.GetInputPort(port))
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.controller = controller
        self._value = self.diagram.get_input_port().FixValue(self.context, self.states[0])
        self._drive = self.diagram.get_output_port()
        inner = projector.GetMyMutableContextFromRoot(self.context)
        projector.set_state(inner, "projection", np.array([THETA]))
        self.diagram.ExecuteInitializationEvents(self.context)
        self._start, self._tick = self.context.Clone(), 0

    def remember(self):
        """Remember the last tick, as a run does; after the last of all begin again."""
        self._tick = (self._tick + 1) % COUNT
        if self._tick:
            self.context.get_mutable_discrete_state().SetFrom(self.updated_memory())
        else:
            self.context.SetTimeStateAndParametersFrom(self._start)

    def updated_memory(self):
        """Return what all systems remember of this tick."""
        return self.diagram.EvalUniquePeriodicDiscreteUpdate(self.context)

    def tick(self):
        """Take a measurement and return the drive torques."""
        self.context.SetTime(PERIOD * self._tick)
        self._value.GetMutableData().get_mutable_value().SetFromVector(self.states[self._tick])
        return self._drive.Eval(self.context)


def make_path(oriented):
    lemniscate = FourierCurve.bent_lemniscate()
    if not oriented:
        return Path(lemniscate)
    theta = np.linspace(0.0, 2.0 * np.pi, 13)
    swing = [0.25 * np.sin(2 * theta), -0.25 * np.cos(theta), -0.25 * np.sin(theta)]
    angles = np.stack(swing, axis=1) + np.array([np.pi, -0.26, 0.0])
    quaternions = zyx_to_quaternion(angles)
    return Path(lemniscate, interpolate_orientation(quaternions, theta, smoothness=5, closed=True))


def make_law(robot, law, oriented):
    linearization = linearize(
        robot, law, PathManifold(RELATIVE_DEGREE[law], oriented=oriented), ActuationOptions(PERIOD)
    )
    r, m, n = linearization.relative_degree, linearization.num_outputs, robot.dimension
    stabilization = Stabilization([gains_from_poles([-50.0] * r)] * m, r, NAMES[:m])
    inverse, safe = DecouplingInverse(1e-4), SafeState(np.full(n, 30.0))
    return FollowingLaw(robot, linearization, stabilization, inverse, np.full(n, 1e6), 0.9, safe)


@pytest.fixture(scope="module", params=CASES, name="chain")
def fixture_chain(request):
    return Chain(*CASES[request.param])


@pytest.mark.slow(but="3R elastic")
def test_whole_tick(chain, benchmark):
    before = chain.tick().copy()
    drive = benchmark.pedantic(chain.tick, setup=chain.remember, rounds=3000, warmup_rounds=50)
    inner = chain.controller.GetMyContextFromRoot(chain.context)
    assert chain.controller.GetOutputPort("fault").Eval(inner) == Fault.NONE
    assert np.all(np.isfinite(drive))
    # every measurement is another one, nothing comes from the cache
    assert not np.array_equal(drive, before)


@pytest.mark.slow(but="3R elastic")
def test_updates(chain, benchmark):
    """What comes on top of a tick, once the drives have their torques."""

    def next_tick():
        chain.remember()
        chain.tick()

    chain.tick()
    benchmark.pedantic(chain.updated_memory, setup=next_tick, rounds=1000, warmup_rounds=50)
    inner = chain.controller.GetMyContextFromRoot(chain.context)
    assert chain.controller.GetOutputPort("fault").Eval(inner) == Fault.NONE


@pytest.mark.slow(but="3R elastic")
def test_projection_and_manifold_point(chain, benchmark):
    evaluator = chain.path.evaluator(chain.law.linearization.relative_degree)
    y_t = (chain.path.position.derivatives(THETA, 0)[0] - 0.002).tolist()
    point = benchmark(evaluator, y_t, THETA - 0.006)
    assert point[0] == pytest.approx(THETA, abs=0.05)


@pytest.mark.slow(but="3R elastic")
def test_law(chain, benchmark):
    linearization = chain.law.linearization
    r, m = linearization.relative_degree, linearization.num_outputs
    rows = np.vstack([chain.coordinates.link_rows, chain.coordinates.motor_rows])
    state = rows @ chain.states[0]
    point = chain.path.evaluator(r).evaluate_at(THETA)
    reference, integral = np.zeros((r + 1) * m), np.zeros(m)
    last_varying_input = np.zeros(linearization.num_joints)
    result = benchmark(chain.law.evaluate, state, point, reference, integral, last_varying_input)
    assert np.all(np.isfinite(result))
