"""The law as a system: parts of the output, memory, faults that hold."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain, MatrixGain

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.impedance import ImpedanceStatus
from pfsc_drake.control.compliance.measured_wrench import SensorFault
from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.control.manifolds.manifold import Projector, ToolKinematics
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import ControllerAccess, FollowingController
from pfsc_drake.systems.fuse import BlockAccess, fuse, fuse_blocks

PERIOD = 1e-3
THETA = 0.6


class Bench:
    """A controller in a context, its inputs beside the path."""

    def __init__(self, arm, path, law, supervision=None):
        self.law = law
        self.system = FollowingController(law, PERIOD, supervision)
        self.context = self.system.CreateDefaultContext()
        sigma = path.position.derivatives(THETA, 0)[0]
        q = arm.reach(sigma + np.array([0.004, -0.006, 0.005]))
        v = np.array([0.1, -0.2, 0.15])
        self.state = np.concatenate([q, v, q, v])
        r = law.linearization.relative_degree
        self.point = path.evaluator(r)(arm.pose(q)[:3].tolist(), THETA)
        self.reference = np.zeros(3 * (r + 1))
        self.reference[0] = self.point[1] + 0.01
        self.fix()

    def fix(self, **inputs):
        names = {"joint_state": "state", "manifold_point": "point", "reference": "reference"}
        for port, name in names.items():
            value = inputs.get(name, getattr(self, name))
            self.system.GetInputPort(port).FixValue(self.context, value)

    def start(self):
        self.simulator = Simulator(self.system, self.context)
        self.simulator.Initialize()

    def tick(self, count=1):
        # the update of the last instant happens when time leaves it
        ticks = round(self.context.get_time() / PERIOD) + count
        self.simulator.AdvanceTo(ticks * PERIOD)

    def output(self, name):
        return self.system.GetOutputPort(name).Eval(self.context).copy()

    @property
    def fault(self):
        return Fault(int(self.output("fault")[0]))

    def remembered(self, name):
        """Return what a block remembers."""
        return BlockAccess(self.system).state(self.context, name)

    def with_nan(self):
        state = self.state.copy()
        state[1] = np.nan
        return state


@pytest.fixture(name="bench")
def fixture_bench(arm, path, make_law):
    return Bench(arm, path, make_law())


def test_parts_are_the_laws_own(bench):
    law = bench.law
    result = law.evaluate(bench.state, bench.point, bench.reference, np.zeros(3))
    assert np.array_equal(bench.output("law"), result)
    assert np.array_equal(bench.output("drive_torque"), result[law.layout.drive])
    for name in ("manifold_state", "virtual_input", "status"):
        assert np.array_equal(bench.output(name), result[getattr(law.layout, name)])
    assert bench.fault == Fault.NONE


def test_the_integral_of_the_error_accumulates(arm, path, make_law):
    bench = Bench(arm, path, make_law(integral=500.0))
    before = bench.output("virtual_input")
    error = bench.output("manifold_state")[:3] - bench.reference[:3]
    bench.start()
    bench.tick(10)
    expected = -500.0 * 10 * PERIOD * error
    assert np.abs(expected).min() > 1e-3
    assert np.allclose(bench.output("virtual_input") - before, expected, rtol=1e-9)


def test_the_integral_does_not_wind_up_while_a_drive_is_at_its_limit(arm, path, make_law):
    """A reference out of reach for a while: afterwards the law is as it was before."""
    bench = Bench(arm, path, make_law(integral=500.0, limit=900.0))
    before = bench.output("virtual_input")
    near, far = bench.reference.copy(), bench.reference.copy()
    far[0] += 5.0
    assert bench.output("status")[2] == 0.0
    bench.start()
    bench.fix(reference=far)
    assert bench.output("status")[2] > 0.0
    bench.tick(50)
    bench.fix(reference=near)
    assert np.array_equal(bench.output("virtual_input"), before)
    # drives that are free again take it up
    bench.tick(10)
    assert np.abs(bench.output("virtual_input") - before).min() > 1e-3


@pytest.mark.parametrize(
    ("cycle", "stops"),
    [((1, 1, 1, 1), True), ((1, 1, 0, -1, -1, 0), True), ((1, 0, 0), False), ((0, 0), False)],
)
def test_drives_at_their_limits_from_one_to_the_other(cycle, stops, arm, path, make_law):
    """Ticks at either limit count; a third of them, or less, is forgiven."""
    watched = SupervisionParameters(
        tolerance=0.0, joint_limits=False, saturation_time=0.02, overspeed=np.inf, chatter_turns=0.0
    )
    bench = Bench(arm, path, make_law(), watched)
    bench.start()
    m, faults = 3, []
    for k in range(120):
        reference = bench.reference.copy()
        reference[-m:] = 1e7 * cycle[k % len(cycle)]
        bench.fix(reference=reference)
        at_limit = bool(bench.output("status")[2])
        faults.append(bench.fault)
        assert at_limit == (cycle[k % len(cycle)] != 0) or faults[-1]
        bench.tick()
    assert (Fault.DRIVE_SATURATED in faults) == stops
    if stops:
        # up by one, and down by a half where it is not at its limit
        rate = np.mean([1.0 if c else -0.5 for c in cycle])
        assert faults.index(Fault.DRIVE_SATURATED) == pytest.approx(20.0 / rate, abs=3.0)


def test_without_integral_part_nothing_accumulates(bench):
    before = bench.output("drive_torque")
    bench.start()
    bench.tick(10)
    assert np.array_equal(bench.output("drive_torque"), before)


def test_a_fault_shows_at_once_and_holds(bench, arm):
    bench.start()
    bench.tick(2)
    bench.fix(state=bench.with_nan())
    assert bench.fault == Fault.INPUT_NOT_FINITE
    bench.tick()
    bench.fix()
    assert bench.fault == Fault.INPUT_NOT_FINITE
    bench.tick(3)
    assert bench.output("status")[0] == Fault.INPUT_NOT_FINITE
    # the measurement is back, and the drives go on to stop the arm: see test_safe_stop
    assert np.isfinite(bench.output("drive_torque")).all()


def test_a_fault_without_measurement_supports_the_weight(bench, arm):
    """Nothing is measured of an arm at rest: the drives hold what it weighs."""
    resting = np.concatenate([bench.state[:3], np.zeros(3), bench.state[:3], np.zeros(3)])
    bench.fix(state=resting)
    bench.start()
    bench.tick(2)
    bench.fix(state=np.full(12, np.nan))
    weight = arm.weight(bench.state[:3])
    assert np.allclose(bench.output("drive_torque"), weight, rtol=0, atol=1e-9)
    bench.tick(200)
    assert np.allclose(bench.output("drive_torque"), weight, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("alarms", "fault"),
    [
        ([0, 1, 0, 0], Fault.NONE),
        ([SensorFault.LOST, 0, 0, 0], Fault.FORCE_SENSOR_LOST),
        ([SensorFault.SATURATED, 1, 0, 0], Fault.FORCE_SENSOR_SATURATED),
        ([SensorFault.JUMPED, 1, 0, 0], Fault.FORCE_SENSOR_JUMPED),
        ([SensorFault.SATURATED, 0, 0, 0], Fault.NONE),
        ([0, 1, ImpedanceStatus.FORCE_NOT_FINITE, 0], Fault.COMPLIANCE_INVALID),
        ([0, 1, 0, 1], Fault.PRESS_FORCE_LOST),
    ],
)
def test_faults_of_others(bench, alarms, fault):
    bench.start()
    bench.system.GetInputPort("alarms").FixValue(bench.context, np.array(alarms, dtype=float))
    assert bench.fault == fault
    bench.tick()
    bench.system.GetInputPort("alarms").FixValue(bench.context, np.zeros(4))
    assert bench.fault == fault


def test_a_later_fault_does_not_replace_the_first(bench):
    bench.start()
    point = bench.point.copy()
    point[bench.law.linearization.manifold.layout.alpha] = 0.95
    bench.fix(point=point)
    bench.tick(2)
    bench.fix(state=bench.with_nan())
    assert bench.fault == Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD


def test_the_integral_rests_during_a_fault(arm, path, make_law):
    bench = Bench(arm, path, make_law(integral=500.0))
    bench.start()
    bench.tick(2)
    integral = bench.remembered("law.integral")
    assert np.abs(integral).min() > 1e-7
    bench.fix(state=bench.with_nan())
    bench.tick(3)
    assert np.array_equal(bench.remembered("law.integral"), integral)


def test_a_new_context_knows_no_fault(bench):
    bench.start()
    bench.fix(state=bench.with_nan())
    bench.tick(2)
    other = bench.system.CreateDefaultContext()
    bench.context = other
    bench.fix()
    assert bench.fault == Fault.NONE


def test_the_last_ticks_drive_is_extrapolated(path):
    """The first tick of the elastic law has nothing to extrapolate, the next ones have."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_elastic_3r")))
    plant.Finalize()
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    linearization = linearize(
        chain, "elastic", PathManifold(RELATIVE_DEGREE["elastic"], oriented=False)
    )
    gains = Stabilization([gains_from_poles([-20.0] * 4)] * 3, 4, ["eta", "xi_1", "xi_2"])
    inverse, safe = DecouplingInverse(1e-4), SafeState(np.full(3, 30.0))
    law = FollowingLaw(chain, linearization, gains, inverse, np.full(3, 1e9), 0.9, safe)
    system = FollowingController(law, PERIOD)
    context = system.CreateDefaultContext()
    q = np.array([0.2, 1.4, -0.4])
    states = [np.concatenate([q, [v, -v, v], q + 1e-3, np.zeros(3)]) for v in (0.1, 0.15)]
    point, reference = path.evaluator(4).evaluate_at(THETA), np.zeros(15)
    system.GetInputPort("manifold_point").FixValue(context, point)
    system.GetInputPort("reference").FixValue(context, reference)
    simulator = Simulator(system, context)
    last_varying_input = None
    for i, state in enumerate(states):
        system.GetInputPort("joint_state").FixValue(context, state)
        expected = law.evaluate(state, point, reference, np.zeros(3), last_varying_input)
        assert expected[law.layout.status][0] == Fault.NONE
        assert np.array_equal(system.GetOutputPort("law").Eval(context), expected)
        simulator.AdvanceTo((i + 1) * PERIOD)
        last_varying_input = expected[law.layout.varying_input]
    assert np.abs(law.evaluate(state, point, reference, np.zeros(3)) - expected).max() > 1.0


def test_outputs_depend_on_inputs_at_once_but_the_state_on_no_reference(bench):
    system = bench.system
    for output in ("law", "drive_torque", "manifold_state", "virtual_input", "status"):
        port = int(system.GetOutputPort(output).get_index())
        for name in ("joint_state", "manifold_point", "reference"):
            expected = (output, name) != ("manifold_state", "reference")
            index = int(system.GetInputPort(name).get_index())
            assert system.HasDirectFeedthrough(index, port) == expected


def closed_loop(arm, path, law, theta):
    """Return a diagram of the arm under the law, without any hold, and the controller."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
    plant.Finalize()
    chain, coordinates = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    rows = np.vstack([coordinates.link_rows, coordinates.motor_rows])
    r = law.linearization.relative_degree
    reference = np.zeros(3 * (r + 1))
    reference[0] = path.arc_length(theta)
    measured = builder.AddSystem(MatrixGain(rows))
    kinematics = builder.AddSystem(BlockSystem(ToolKinematics(chain), PERIOD))
    projector = builder.AddSystem(BlockSystem(Projector(path.evaluator(r)), PERIOD))
    controller = builder.AddSystem(FollowingController(law, PERIOD))
    source = builder.AddSystem(ConstantVectorSource(reference))
    builder.Connect(plant.get_state_output_port(), measured.get_input_port())
    builder.Connect(measured.get_output_port(), kinematics.GetInputPort("joint_state"))
    builder.Connect(measured.get_output_port(), controller.GetInputPort("joint_state"))
    builder.Connect(kinematics.get_output_port(), projector.GetInputPort("tool_pose"))
    builder.Connect(projector.get_output_port(), controller.GetInputPort("manifold_point"))
    builder.Connect(source.get_output_port(), controller.GetInputPort("reference"))
    # the plant's state does not depend on the torque at once, so nothing is algebraic
    builder.Connect(controller.GetOutputPort("drive_torque"), plant.get_actuation_input_port())
    return builder.Build(), plant, controller


@pytest.mark.slow
def test_the_loop_over_a_plant_is_not_algebraic_and_converges(arm, path, make_law):
    """Double poles at -20: from rest the errors obey e_0 (1 + 20 t) exp(-20 t)."""
    diagram, plant, controller = closed_loop(arm, path, make_law(), THETA)
    context = diagram.CreateDefaultContext()
    sigma = path.position.derivatives(THETA, 0)[0]
    q = arm.reach(sigma + np.array([0.004, -0.006, 0.005]))
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), q)
    simulator = Simulator(diagram, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-8)
    simulator.Initialize()
    inner = controller.GetMyContextFromRoot(context)
    output = controller.GetOutputPort("manifold_state")
    before = output.Eval(inner)[:3].copy()
    eta_p = path.arc_length(THETA)
    simulator.AdvanceTo(0.1)
    expected = (before - [eta_p, 0.0, 0.0]) * 3.0 * np.exp(-2.0)
    assert np.abs(expected).min() > 1e-4
    error = output.Eval(inner)[:3] - [eta_p, 0.0, 0.0]
    assert np.allclose(error, expected, rtol=0, atol=1e-7)
    assert controller.GetOutputPort("fault").Eval(inner)[0] == Fault.NONE


def test_a_loop_from_the_drives_to_the_measurement_is_refused(bench):
    """The torque acts immediately; Drake sees a loop that has no solution in time."""
    builder = DiagramBuilder()
    controller = builder.AddSystem(bench.system)
    gain = builder.AddSystem(MatrixGain(np.ones((12, 3))))
    builder.Connect(controller.GetOutputPort("drive_torque"), gain.get_input_port())
    builder.Connect(gain.get_output_port(), controller.GetInputPort("joint_state"))
    with pytest.raises(RuntimeError, match="algebraic loop"):
        builder.Build()


def test_external_torques_reach_the_law(bench):
    bench.system.GetInputPort("tau_ext").FixValue(bench.context, [3.0, -2.0, 1.0])
    expected = bench.law.evaluate(
        bench.state,
        bench.point,
        bench.reference,
        np.zeros(3),
        tau_ext=np.array([3.0, -2.0, 1.0]),
    )
    assert np.array_equal(bench.output("law"), expected)
    # a rigid joint's drive bears the torque itself (3.29)
    bench.system.GetInputPort("tau_ext").FixValue(bench.context, np.zeros(3))
    difference = expected[bench.law.layout.drive] - bench.output("drive_torque")
    assert np.allclose(difference, [-3.0, 2.0, -1.0], rtol=0, atol=1e-9)


def test_external_torque_that_is_not_finite_is_a_fault(bench):
    bench.system.GetInputPort("tau_ext").FixValue(bench.context, [0.0, np.nan, 0.0])
    assert bench.fault == Fault.INPUT_NOT_FINITE


@pytest.mark.parametrize("fused", [True, False])
def test_what_is_found_is_read_by_name_fused_or_not(fused, arm, path, make_law):
    bench = Bench(arm, path, make_law(), SupervisionParameters())
    builder = DiagramBuilder()
    controller = builder.AddNamedSystem(
        "controller", FollowingController(bench.law, PERIOD, SupervisionParameters())
    )
    access = ControllerAccess(controller)
    names = {"joint_state": "state", "manifold_point": "point", "reference": "reference"}
    source = builder.AddNamedSystem("joint_state", Gain(np.ones(12)))
    builder.ExportInput(source.get_input_port(), "joint_state")
    builder.Connect(source.get_output_port(), controller.GetInputPort("joint_state"))
    for port in ("manifold_point", "reference"):
        constant = builder.AddSystem(ConstantVectorSource(getattr(bench, names[port])))
        builder.Connect(constant.get_output_port(), controller.GetInputPort(port))
    if fused:
        fuse_blocks(builder)
    diagram = builder.Build()
    blocks, simulator = BlockAccess(diagram), Simulator(diagram)
    root = simulator.get_mutable_context()
    inputs = diagram.GetInputPort("joint_state")
    inputs.FixValue(root, bench.state)
    simulator.Initialize()
    assert access.fault(blocks, root) == Fault.NONE
    torque = access.drive(blocks, root)
    assert np.array_equal(torque, bench.output("drive_torque"))
    simulator.AdvanceTo(2 * PERIOD)
    access.set_last_state(blocks, root, bench.state)
    jumped = bench.state + 0.01 * np.eye(12)[7]
    inputs.FixValue(root, jumped)
    assert access.fault(blocks, root) == Fault.MEASUREMENT_IMPLAUSIBLE
    assert np.flatnonzero(access.suspects(blocks, root)).tolist() == [7]
    simulator.AdvanceTo(2.5 * PERIOD)
    inputs.FixValue(root, bench.state)
    # between ticks nothing is known but what is remembered
    assert access.fault(blocks, root) == Fault.MEASUREMENT_IMPLAUSIBLE
    assert np.flatnonzero(access.suspects(blocks, root)).tolist() == [7]


def test_any_input_leads_to_finite_torques_within_limits(arm, path, make_law):
    bench = Bench(arm, path, make_law(integral=500.0, limit=900.0), SupervisionParameters())
    network = fuse(FollowingController(bench.law, PERIOD, SupervisionParameters())).network
    good = {name: np.zeros(port.size) for name, port in network.inputs.items()}
    good["joint_state"], good["manifold_point"] = bench.state, bench.point
    good["reference"] = bench.reference
    rng, controller, faults = np.random.default_rng(7), Stepper(network), set()
    anything = [np.nan, np.inf, -np.inf, 1e308, -1e200, 1e20, -1e-320, 0.0]
    for _ in range(150):
        controller.start(**good)
        for k in range(4):
            inputs = {name: value.copy() for name, value in good.items()}
            for value in inputs.values():
                spoiled = rng.random(value.size) < (k > 0) * rng.choice([0.0, 0.05, 0.5, 1.0])
                value[spoiled] = rng.choice(anything, spoiled.sum())
            found = controller.step(**inputs)
            assert np.all(np.abs(found["drive_torque"]) <= bench.law.limits)
            faults.add(Fault(int(found["fault"][0])))
    assert {Fault.NONE, Fault.INPUT_NOT_FINITE, Fault.MEASUREMENT_IMPLAUSIBLE} < faults
