"""Closed loop of a station, linearized over one sampling period."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, LeafSystem

from diagrams.builder import build_station
from diagrams.integration import continuous_modes
from diagrams.one_period_map import OnePeriodMap
from diagrams.period_map import PeriodDerivative, RestSlope
from diagrams.robots.arm import Arm
from diagrams.robots.arm_model import nominal_arm
from diagrams.scenario import Scenario
from diagrams.station import Station
from diagrams.station_options import StationOptions
from experiments.simulation import configure
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.margins import in_loop
from pfsc_drake.systems.physics.surface_spring import SurfaceSpring

Kind = TypeVar("Kind", bound=LeafSystem)

# accurate enough for eigenvalues while no mode turns by more than 1 rad per step; RK3 would damp
# such a resonance by 30 1/s at 1 ms
_SCHEME, _MOST_STEPS = "runge_kutta5", 100
# smaller derivatives are residuals of iterations
_ROUNDING = 1e-10
# largest tried factor of a touched surface's stiffness
STIFFEST = 64.0
_SENSOR, _FAULT = "controller.tool_compensation", "fault_latch.fault"


class StationLoop:
    """Station with the map of one sampling period.

    Args:
        settings: The scenario without non-differentiable effects.
        folder: Base folder of relative file names.
        like: Existing loop that differs only in its nominal model, or None.

    Attributes:
        station: The station.
        map: The map.
        derivative: Derivative of the map.
        drives: Indices of the variables that hold the drive commands, shape (N,).
        drives_are_servos: Whether commands are velocities for faster servos, not torques.
        spring: Spring in place of a contact, if there is one.
        parameters: Parameters of another nominal model by name, see :meth:`with_nominal_model`.
    """

    parameters: Mapping[str, float] | None = None

    def __init__(self, settings: Scenario, folder: Path, like: "StationLoop | None" = None) -> None:
        settings = _without_brakes(settings)
        built = None if like is None else like.station
        self.station: Station = build_station(settings, folder, like=built, with_slope=True)
        diagram, period = self.station.diagram, self.station.controller.period
        self.spring = _only(diagram, SurfaceSpring)
        self._has_sensor = settings.needs_sensor
        self._step: float = self._accurate_step() if like is None else like._step
        self.map = OnePeriodMap(diagram, period, self.configure)
        plant = self.map.rows(self.station.part.plant)
        self.derivative = PeriodDerivative(self.map, diagram, self.configure, plant)
        self.drives, self.drives_are_servos = self._find_drives()

    def parametrize(self, settings: Scenario, folder: Path) -> bool:
        """Make the controller a function of mass and stiffness parameters, if possible.

        It is possible for torque-controlled serial arms whose commands are expressions of these
        parameters; not if poles, servos or a force sensor's compensation are precomputed from them.

        Args:
            settings: The scenario, possibly with another nominal model.
            folder: Base folder of relative file names.

        Returns:
            Whether :meth:`with_nominal_model` can be called.
        """
        law = settings.controller.law
        gains = settings.controller.gains.get(law)
        precomputed = (
            settings.needs_sensor
            or RELATIVE_DEGREE[law] == 1
            or gains is None
            or gains.is_automatic
            or not isinstance(self.station.part, Arm)
        )
        if precomputed or not (self.rest_is_physics and self.derivative.can_be_parametrized):
            return False
        settings = _without_brakes(settings)
        twin = build_station(settings, folder, like=self.station, with_slope=True, parametric=True)
        self.derivative.parametrize(twin.diagram)
        return True

    def with_nominal_model(self, settings: Scenario, folder: Path) -> "StationLoop":
        """Return the loop of a controller with another nominal model.

        Args:
            settings: The scenario of :meth:`parametrize` with other mass and stiffness parameters.
            folder: Base folder of relative file names.
        """
        part = self.station.part
        assert isinstance(part, Arm)  # others are not parametrized
        other = copy(self)
        other.parameters = nominal_arm(
            part.actual, StationOptions(settings, folder).nominal_model_source
        )[0].parameters
        return other

    def configure(self, simulator: Simulator) -> None:
        """Configure a simulator with the map's integration.

        Args:
            simulator: The simulator, not yet initialized.
        """
        configure(simulator, _SCHEME, self._step)

    @property
    def rest_is_physics(self) -> bool:
        """Whether plant and spring alone have state beside blocks, independent of the model."""
        physics = [self.map.rows(self.station.part.plant)]
        physics += [] if self.spring is None else [self.map.rows(self.spring)]
        return np.array_equal(self.derivative.rest, np.sort(np.concatenate(physics)))

    def has_failed(self, root: Context) -> bool:
        """Return whether a system is in its safe state.

        Args:
            root: Context of the diagram before the update of a tick.
        """
        accesses = [self.station.controller, self.station.servo]
        faults = [a.fault(self.station.blocks, root) for a in accesses if a is not None]
        return any(fault is not Fault.NONE for fault in faults)

    def external_load(self, section: Context) -> np.ndarray | None:
        """Return the external load on a force sensor [N, Nm], shape (6,).

        Args:
            section: Context right after a tick.

        Returns:
            Load in the sensor's frame; None without a tared sensor.
        """
        if not self._has_sensor:
            return None
        wires = self.derivative.wires(section)
        if not wires[f"{_SENSOR}.tared"]:
            return None
        bias = self.station.blocks.state(section, f"{_SENSOR}.bias")
        return wires[f"{_SENSOR}.residual"] - bias

    def tare(self, section: Context, load: np.ndarray) -> None:
        """Tare the force sensor at a section for a known external load.

        The weight of an unknown mass is then compensated, as after taring in a run; its inertia
        remains.

        Args:
            section: Context right after a tick, whose sensor is tared.
            load: External load.
        """
        blocks = self.station.blocks
        residual = self.derivative.wires(section)[f"{_SENSOR}.residual"]
        blocks.set_state(section, f"{_SENSOR}.bias", residual - load)
        blocks.set_state(section, f"{_SENSOR}.tared", np.ones(1))

    def needs_taring(self, section: Context) -> bool:
        """Return whether there is an untared force sensor.

        Args:
            section: Context right after a tick.
        """
        return self._has_sensor and self.external_load(section) is None

    def hang(self, section: Context, joint: str, mass: float) -> None:
        """Add an unmodelled mass below the force sensor at a section.

        Args:
            section: Context right after a tick.
            joint: Joint of the sensor, see :meth:`~diagrams.robots.part.RobotPart.hang`.
            mass: Mass [kg].

        Raises:
            InputError: If the plant does not support it.
        """
        part = self.station.part
        part.hang(part.plant.GetMyMutableContextFromRoot(section), joint, mass)

    def pressed_force(self, section: Context) -> float:
        """Return the force of the spring [N]; zero without one.

        Args:
            section: Context right after a tick.
        """
        if self.spring is None:
            return 0.0
        return self.spring.force(self.spring.GetMyContextFromRoot(section))

    def stiffened(self, section: Context, stiffness: float) -> Context:
        """Return a section with another spring under the same force.

        Args:
            section: Context right after a tick; unchanged.
            stiffness: Stiffness of the other spring [N/m].
        """
        assert self.spring is not None
        result = section.Clone()
        own = self.spring.GetMyMutableContextFromRoot(result)
        self.spring.set_stiffness(own, stiffness, self.pressed_force(section))
        return result

    def variables_in_loop(self, sections: list[Context]) -> np.ndarray:
        """Return the variables that are part of the loop through plant and controller.

        Args:
            sections: Contexts right after a tick; variables in the loop at any of them count.
        """
        core = np.zeros(self.map.size, dtype=bool)
        core[self.map.rows(self.station.part.plant)] = True
        core[self.drives] = True
        found = core
        for section in sections:
            slope = self.derivative.at(section, parameters=self.parameters)
            changes = np.abs(slope.A) > _ROUNDING
            found = found | in_loop(changes, core)
        return np.flatnonzero(found)

    def _accurate_step(self) -> float:
        station = self.station
        root, period = station.diagram.CreateDefaultContext(), station.controller.period
        station.set_start(root)
        if root.num_continuous_states() == 0:
            return period
        if self.spring is not None:
            own = self.spring.GetMyMutableContextFromRoot(root)
            self.spring.set_stiffness(own, STIFFEST * self.spring.stiffness, 1.0)
        fastest = float(np.max(np.abs(continuous_modes(station.diagram, root))))
        return period / min(max(int(np.ceil(fastest * period)), 1), _MOST_STEPS)

    def _find_drives(self) -> tuple[np.ndarray, bool]:
        """Return the variables at which the loop can be opened at its own sampling time."""
        N, states = self.station.robot.dimension, self.derivative.states
        if "bus_delay.samples" in states:  # the newest
            return states["bus_delay.samples"][:N], True
        is_servo = "velocity_hold.held" in states
        # the newest of the pending commands
        return states["velocity_hold.held" if is_servo else "hold.held"][-N:], is_servo


def _without_brakes(settings: Scenario) -> Scenario:
    """Return a scenario with fused blocks and without brakes, which close only after faults."""
    # fused blocks are three times as fast
    simulation = replace(settings.simulation, fused=True)
    return replace(settings, simulation=simulation, faults=replace(settings.faults, brakes=None))


def _only(diagram: Diagram, kind: type[Kind]) -> Kind | None:
    """Return the system of a kind, if there is one."""
    return next((system for system in diagram.GetSystems() if isinstance(system, kind)), None)


@dataclass(frozen=True)
class LinearLoop:
    """A loop linearized at one instant.

    Attributes:
        A: Map of one period for the variables in the loop, shape (n, n).
        holds: Indices of the drives' commands among them, shape (N,).
        rest: Slopes of systems other than blocks.
    """

    A: np.ndarray
    holds: np.ndarray
    rest: Sequence[RestSlope] = ()


def linearize(
    loop: StationLoop, section: Context, chosen: np.ndarray, rest: Sequence[RestSlope] = ()
) -> LinearLoop | None:
    """Linearize a loop at an instant.

    Args:
        loop: The loop.
        section: Context right after a tick.
        chosen: The variables in the loop, in increasing order.
        rest: Slopes of systems other than blocks, if known.

    Returns:
        The linear loop; None if the law goes to its safe state there.
    """
    slope = loop.derivative.at(section, chosen, rest, loop.parameters)
    if any(fault.any() for name, fault in slope.wires.items() if name.endswith(_FAULT)):
        return None
    return LinearLoop(slope.A, np.searchsorted(chosen, loop.drives), slope.rest)
