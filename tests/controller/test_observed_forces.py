"""Observers of forces and of friction: inputs, and velocities."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.momentum import (
    MomentumObserver,
    drive_momentum,
    link_momentum,
)
from pfsc_drake.controller import friction_compensation as friction_module
from pfsc_drake.controller.friction_compensation import add_friction_compensation
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.observed_forces import add_observed_forces
from pfsc_drake.controller.options.compliance_parameters import ObservedForceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.friction_parameters import FrictionCompensationParameters
from pfsc_drake.robot.tool_load import joint_torque_function

PERIOD, DELAY = 1e-3, 5e-4
F_C, F_V = np.array([40.0, 90.0, 20.0]), np.array([14.0, 97.0, 39.0])


class Bench:
    """A builder, and what stands in for a controller of torques: a source behind each port."""

    relative_degree = 2

    def __init__(self, robot):
        n = robot.dimension
        self.builder, self.robot = DiagramBuilder(), robot
        self.nominal = NominalRobot(robot, (F_C, F_V), velocity_delay=DELAY)
        sizes = {"joint_state": 4 * n, "friction": n, "tau_ext": n, "drive_torque": n}
        self.ports = {name: self._source(size) for name, size in sizes.items()}
        self._told = self.builder.AddSystem(PassThrough(n)).get_input_port()

    def _source(self, size):
        return self.builder.AddSystem(ConstantVectorSource(np.zeros(size))).get_output_port()

    def GetOutputPort(self, name):
        return self.ports[name]

    def GetInputPort(self, name):
        assert name == "friction_torque"
        return self._told

    def system(self, name):
        """Return a system that was added."""
        (found,) = [s for s in self.builder.GetSystems() if s.get_name() == name]
        return found

    def feeds(self, system, port):
        """Return what a port is fed by."""
        number = system.GetInputPort(port).get_index()
        fed = self.builder.connection_map()
        ((source, _),) = [fed[s, k] for s, k in fed if s is system and k == number]
        return source


def assert_observes(block, expected):
    """Both have the same outputs for random inputs."""
    rng, n = np.random.default_rng(0), expected.outputs["estimate"].size
    steppers = [Stepper(each, ("known_torque",)) for each in (block, expected)]
    for _ in range(3):
        told = {"joint_state": rng.normal(size=4 * n), "known_torque": rng.normal(size=n)}
        told["drive_torque"] = 100.0 * rng.normal(size=n)
        found, right = (stepper.step(**told)["estimate"] for stepper in steppers)
        np.testing.assert_array_equal(found, right)
    assert np.abs(right).max() > 1.0


def test_forces_are_observed_with_old_velocities_and_without_friction(load_arm):
    bench = Bench(load_arm("comau_racer_1_4_3r").chain)
    options = ControllerParameters("rigid")
    tool = ObservedForceParameters(rate=80.0)
    add_observed_forces(bench.builder, bench.nominal, options, tool, bench, bench.ports)
    observer = bench.system("tool_force_observer")
    model = link_momentum(bench.robot).with_delay(DELAY)
    assert_observes(observer.block, MomentumObserver(model, 80.0, PERIOD))
    for port, name in (("known_torque", "friction"), ("drive_torque", "drive_torque")):
        assert bench.feeds(observer, port) is bench.ports[name].get_system()


def test_forces_and_torques_on_the_tool_have_dead_bands_of_their_own(load_arm):
    bench = Bench(load_arm("comau_racer_1_4").chain)
    tool = ObservedForceParameters(damping=0.0, force_dead_band=3.0, torque_dead_band=0.5)
    options = ControllerParameters("rigid")
    add_observed_forces(bench.builder, bench.nominal, options, tool, bench, bench.ports)
    q = np.array([0.2, 1.6, -0.5, 0.1, 1.2, 0.1])
    tau = joint_torque_function(bench.robot)(q, [10.0, 0.0, 0.0, 0.0, 2.0, 0.0]).full().ravel()
    fit = Stepper(bench.system("tool_wrench").block)
    found = fit.step(tau_ext=tau, joint_state=np.tile([*q, *np.zeros(6)], 2))["wrench"]
    np.testing.assert_allclose(found, [7.0, 0.0, 0.0, 0.0, 1.5, 0.0], atol=1e-9)


def test_friction_is_observed_with_old_velocities_and_without_forces(load_arm):
    bench = Bench(load_arm("comau_racer_1_4_3r").chain)
    options = ControllerParameters(
        "rigid", friction=FrictionCompensationParameters(source="observer", rate=70.0)
    )
    add_friction_compensation(bench.builder, bench.nominal, options, bench, bench.ports)
    observer = bench.system("friction_observer")
    model = drive_momentum(bench.robot).with_delay(DELAY)
    assert_observes(observer.block, MomentumObserver(model, 70.0, PERIOD))
    assert bench.feeds(observer, "known_torque") is bench.ports["tau_ext"].get_system()


class Asked(Exception):
    """Arguments of the call."""


def test_coefficients_drift_by_a_thousandth_of_what_is_believed(load_arm, monkeypatch):
    def ask(*given, **more):
        raise Asked(*given)

    monkeypatch.setattr(friction_module, "FrictionKalmanFilter", ask)
    bench = Bench(load_arm("comau_racer_1_4_3r").chain)
    friction = FrictionCompensationParameters(source="observer", observer="kalman")
    friction.kalman.start = 0.8
    options = ControllerParameters("rigid", friction=friction)
    with pytest.raises(Asked) as asked:
        add_friction_compensation(bench.builder, bench.nominal, options, bench, bench.ports)
    momentum, start, noise, period = asked.value.args
    assert (momentum.delay, period) == (DELAY, PERIOD)
    np.testing.assert_allclose(start, [0.8 * F_C, 0.8 * F_V])
    np.testing.assert_allclose(noise.coulomb, 1e-6 * F_C**2)
    np.testing.assert_allclose(noise.viscous, 1e-6 * F_V**2)
