"""Choice of the cheapest accurate integration: ``simulation.integrator: auto``."""

import contextlib
from collections.abc import Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from diagrams.integration import STABILITY, Integration, continuous_modes, is_stable
from diagrams.robots.plant_friction import FRICTION_INTEGRATORS
from diagrams.scenario import SimulationParameters
from diagrams.scenario.simulation import AUTO
from diagrams.station import Station
from experiments.simulation import configure
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.systems.physics.joint_friction import JointFriction

# error of joint and tool positions [rad, m] that is small enough
_TOLERANCE = 1e-6
# the step that errors are measured against is shorter by this factor, its scheme the best
_FINER, _BEST = 5, "runge_kutta5"
# length of a trial: steps, or ticks of the controller if that is more, within bounds
_STEPS, _TICKS, _MOST_STEPS = 100, 20, 500
# rad/s or m/s, of every joint when a trial starts
_SPEED = 0.05
# part of 1 by which halving the step must shrink the error, else it comes from switching
_PROGRESS = 0.25
_HALVINGS_TO_BE_ACCURATE, _HALVINGS_TO_BE_STABLE = 2, 8


def choose_integration(
    station: Station, parameters: SimulationParameters, begin: float
) -> Integration:
    """Return the integration of a station: the scenario's, or with ``auto`` the cheapest.

    The station is tried in closed loop from its start, in contexts of their own, with every joint
    in slow motion, so that all modes are excited, wherever the scenario starts. Reference and
    forces are those from ``begin`` on. The cheapest scheme is taken whose error, against steps five
    times shorter, stays below 1e-6 rad and m; if there is none, shorter steps. A scheme that makes
    a mode of the plant unstable is never taken, whatever its error. Friction and encoders switch,
    and an error that no shorter step reduces is accepted.

    Args:
        station: The station.
        parameters: Parameters of the scenario.
        begin: Time when the reference leaves its first rest [s].

    Raises:
        InputError: If every step within reach is unstable.
    """
    scheme, step = parameters.integrator, parameters.max_step
    if scheme != AUTO:
        return Integration(scheme, step, "as the scenario says")
    if parameters.accuracy > 0.0:
        accuracy = f"error control with accuracy {parameters.accuracy:g}"
        return Integration("runge_kutta3", step, f"the scheme whose {accuracy} can be relied on")
    step = min(step, station.controller.period)
    plant = station.part.plant
    if isinstance(plant, MultibodyPlant) and plant.time_step() > 0.0:
        period = plant.time_step() * 1e3
        return Integration(
            "runge_kutta3", step, f"the plant has time steps of its own, {period:g} ms"
        )
    return _Search(station, begin).run(step)


class _Search:
    """Trials of a station with several schemes."""

    def __init__(self, station: Station, begin: float) -> None:
        self._station, self._begin, self._duration = station, begin, 0.0
        self._pose = pose_function(station.robot)
        coordinates, n = station.part.coordinates, station.robot.dimension
        joint_state = coordinates.rows @ station.initial_state
        joint_state.reshape(4, n)[[1, 3]] = _SPEED
        self._state = coordinates.plant_state(joint_state)
        systems = station.diagram.GetSystems()
        self._rough = any(isinstance(system, JointFriction) for system in systems)
        simulator = self._start(_BEST, station.controller.period)
        self._modes = continuous_modes(station.diagram, simulator.get_context())

    def run(self, longest: float) -> Integration:
        """Return the cheapest integration with steps up to one [s].

        Raises:
            InputError: If every step within reach is unstable.
        """
        schemes = FRICTION_INTEGRATORS if self._rough else tuple(STABILITY)
        step, stable = longest, self._stable(schemes, longest)
        while not stable and step > longest / 2**_HALVINGS_TO_BE_STABLE:
            step /= 2.0
            stable = self._stable(schemes, step)
        if not stable:
            raise InputError(
                f"simulation.integrator: auto: the robot's fastest mode, "
                f"{np.abs(self._modes).max():.3g} rad/s, is unstable with every step down to "
                f"{step:.3g} s; allowed: a shorter simulation.max_step, or runge_kutta3 with "
                "simulation.accuracy"
            )
        ticks = round(self._station.controller.period / step * _TICKS)
        self._duration = step * min(max(_STEPS, ticks), _MOST_STEPS)
        errors = self._errors(stable, step)
        first = (stable, step, errors)
        for _ in range(0 if self._rough else _HALVINGS_TO_BE_ACCURATE):
            if min(errors) <= _TOLERANCE:
                break
            finer = self._errors([_BEST], step / 2.0)
            if finer[0] > _PROGRESS * min(errors):
                stable, step, errors = first  # shorter steps do not help
                break
            stable, step, errors = [_BEST], step / 2.0, finer
        return self._cheapest(stable, step, errors)

    def _cheapest(
        self, schemes: Sequence[str], step: float, errors: Sequence[float]
    ) -> Integration:
        if not np.isfinite(min(errors)):
            return Integration(schemes[-1], step, "nothing could be measured: no sample is finite")
        enough = max(_TOLERANCE, 2.0 * min(errors))
        scheme, error = next((s, e) for s, e in zip(schemes, errors, strict=False) if e <= enough)
        against = f"over the first {self._duration:.3g} s, against steps {_FINER} times shorter"
        reason = f"the cheapest with an error below {_TOLERANCE:g} (rad, m): {error:.2g} {against}"
        if error > _TOLERANCE:
            reason = f"error {error:.2g} (rad, m) {against}; no scheme comes below {_TOLERANCE:g}"
        return Integration(scheme, step, reason)

    def _stable(self, schemes: Sequence[str], step: float) -> list[str]:
        return [scheme for scheme in schemes if is_stable(scheme, step, self._modes)]

    def _errors(self, schemes: Sequence[str], step: float) -> list[float]:
        """Largest error of each scheme [rad, m], up to the first that is small enough.

        It is infinite where a scheme fails.
        """
        truth = self._positions(_BEST, step / _FINER)
        errors = []
        for scheme in schemes:
            tried = self._positions(scheme, step)
            complete = len(tried) >= len(truth) > 0
            error = float(np.abs(tried[: len(truth)] - truth).max()) if complete else np.inf
            errors.append(error)
            if error <= _TOLERANCE:
                break  # those that follow cost more
        return errors

    def _positions(self, scheme: str, step: float) -> np.ndarray:
        """Return finite positions of links, motors and tool at the ticks.

        Returns:
            Shape (samples, 2N + 3) [rad, m].
        """
        simulator, station = self._start(scheme, step), self._station
        root = simulator.get_context()
        with contextlib.suppress(RuntimeError):  # what was logged until then counts
            simulator.AdvanceTo(self._begin + self._duration)
        n, state = station.robot.dimension, station.log.read(root)[1]["joint_state"]
        finite = np.isfinite(state).all(axis=1)
        state = state[: len(state) if finite.all() else int(np.argmin(finite))]
        q_J, q_M = state[:, :n], state[:, 2 * n : 3 * n]
        if len(state) == 0:
            return np.zeros((0, 2 * n + 3))
        y_t = np.array(self._pose.map(len(q_J))(q_J.T))[:3].T
        return np.hstack([q_J, q_M, y_t])

    def _start(self, scheme: str, step: float) -> Simulator:
        """Return a simulator with the robot at its start, in motion, as the reference departs."""
        simulator = Simulator(self._station.diagram)
        configure(simulator, scheme, step)
        root = simulator.get_mutable_context()
        root.SetTime(self._begin)
        self._station.set_start(root)
        self._station.set_robot_state(root, self._state)
        simulator.Initialize()
        return simulator
