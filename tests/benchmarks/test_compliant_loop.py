"""Time of the compliant closed loop, and of its pieces one by one.

A piece is evaluated in a context of its own with the values that it sees in the loop.
Alone, its code stays in the processor's caches: in the loop it takes up to twice as long.
"""

from pathlib import Path

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from pfsc_drake.yaml.typed import load_file

SCENARIOS = Path(__file__).resolve().parents[2] / "experiments" / "scenarios"
SPAN = 0.2
# system, output port
OUTPUTS = [
    ("controller/tool_kinematics", "tool_pose"),
    ("controller/path_projector", "manifold_point"),
    ("controller/reference_generator", "reference"),
    ("controller/following_controller", "law"),
    ("force_torque_sensor", "measured_wrench"),
    ("controller/tool_compensation", "wrench"),
    ("controller/manifold_force_transform", "manifold_force"),
    ("controller/impedance_filter", "reference"),
    ("operator", "wrench"),
    ("external_wrench", "applied_spatial_force"),
    ("external_wrench", "tau_ext"),
]
UPDATES = [
    "force_torque_sensor",
    "controller/tool_compensation",
    "controller/impedance_filter",
    "operator",
]


class Loop:
    """The shipped compliant closed loop amid its first push."""

    def __init__(self):
        file = SCENARIOS / "pfc_compliant_6r.yaml"
        self.scenario = load_file(Scenario, file)
        self.scenario.simulation.fused = False
        for pulse in self.scenario.forces:
            pulse.begin, pulse.end = 0.1, 10.0
        self.station = build_station(self.scenario, SCENARIOS)
        self.simulator = Simulator(self.station.diagram)
        simulation = self.scenario.simulation
        ApplySimulatorConfig(
            SimulatorConfig(
                integration_scheme=simulation.integrator,
                max_step_size=simulation.max_step,
                use_error_control=False,
            ),
            self.simulator,
        )
        self.root = self.simulator.get_mutable_context()

    def restart(self):
        self.root.SetTime(0.0)
        self.station.set_start(self.root)
        self.simulator.Initialize()

    def isolate(self, name):
        """Return a system, its inputs' values, and a context of its own that holds them."""
        system = self.station.diagram
        for part in name.split("/"):
            system = system.GetSubsystemByName(part)
        inside = system.GetMyContextFromRoot(self.root)
        context, fixed = system.CreateDefaultContext(), []
        context.SetTimeStateAndParametersFrom(inside)
        for i in range(system.num_input_ports()):
            port = system.get_input_port(i)
            if port.HasValue(inside):
                value = port.Eval(inside)
                if isinstance(value, list):
                    value = Value[list[SpatialForce]](value)
                fixed.append(port.FixValue(context, value))
        return system, fixed, context


def touch(fixed, context):
    """Make the context forget what it has calculated."""
    for value in fixed:
        value.GetMutableData()
    if not fixed:
        context.SetTime(context.get_time())


@pytest.fixture(name="loop", scope="module")
def fixture_loop():
    loop = Loop()
    loop.restart()
    loop.simulator.AdvanceTo(0.25)
    return loop


@pytest.mark.slow
def test_closed_loop(benchmark):
    loop = Loop()
    benchmark.pedantic(
        lambda: loop.simulator.AdvanceTo(SPAN), setup=loop.restart, rounds=7, iterations=1
    )
    assert loop.root.get_time() == SPAN
    if benchmark.stats is not None:
        benchmark.extra_info["real_time_factor"] = SPAN / benchmark.stats.stats.median


@pytest.mark.slow
@pytest.mark.parametrize(("name", "port"), OUTPUTS)
def test_output(loop, benchmark, name, port):
    system, fixed, context = loop.isolate(name)
    output = system.GetOutputPort(port)
    expected = output.Eval(system.GetMyContextFromRoot(loop.root))

    def evaluate():
        touch(fixed, context)
        return output.Eval(context)

    value = benchmark(evaluate)
    if port != "applied_spatial_force":
        np.testing.assert_allclose(value, expected, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", UPDATES)
def test_update(loop, benchmark, name):
    """The state of the next tick, with the outputs of this one that it follows from."""
    system, fixed, context = loop.isolate(name)

    def evaluate():
        touch(fixed, context)
        return system.EvalUniquePeriodicDiscreteUpdate(context)

    state = benchmark(evaluate)
    assert np.isfinite(state.value()).any()


@pytest.mark.slow
def test_plant(loop, benchmark):
    """Accelerations and reaction forces, as the sensor asks for them."""
    plant = loop.station.part.plant
    context = plant.CreateDefaultContext()
    state = loop.station.initial_state
    plant.get_actuation_input_port().FixValue(context, np.zeros(plant.num_actuators()))

    def evaluate():
        plant.SetPositionsAndVelocities(context, state)
        return plant.get_reaction_forces_output_port().Eval(context)

    assert len(benchmark(evaluate)) == plant.num_joints()
