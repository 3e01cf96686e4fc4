"""Who makes the lap: laws of this project, an impedance, joint servos on a plan."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from diagrams.robot_station import RobotStation
from experiments.studies.peers.lap import FOLDER, Lap, start_posture
from experiments.studies.peers.laws import CartesianImpedance, ImpedanceGains, JointServos
from experiments.studies.peers.world import RobotMotion, under_law, under_own_law

_BANDWIDTH = 40.0  # 1/s, of path following, tracking and servos alike


class Contestant(Protocol):
    """Whoever can make a lap."""

    def run(self, lap: Lap, disturbance: tuple[str, ...]) -> RobotMotion:
        """Make a lap.

        Args:
            lap: The lap.
            disturbance: What disturbs it, as overrides of the scenario.
        """


@dataclass(frozen=True)
class OwnLaw:
    """A law of this project.

    Attributes:
        overrides: What is changed in the scenario for it.
    """

    overrides: tuple[str, ...]

    def run(self, lap: Lap, disturbance: tuple[str, ...]) -> RobotMotion:
        """Make a lap."""
        settings = lap.settings((*self.overrides, *disturbance))
        return under_own_law(settings, FOLDER, lap.duration)


@dataclass(frozen=True)
class Impedance:
    """A Cartesian impedance whose target moves as the reference does.

    Attributes:
        gains: Its gains.
    """

    gains: ImpedanceGains

    def run(self, lap: Lap, disturbance: tuple[str, ...]) -> RobotMotion:
        """Make a lap."""

        def make(station: RobotStation) -> CartesianImpedance:
            robot = station.part.belief.robot
            return CartesianImpedance(robot, self.gains, lap.target, start_posture(station))

        return under_law(lap.settings(disturbance), FOLDER, lap.duration, make)


@dataclass(frozen=True)
class Servos:
    """Joint servos along the fastest motion that Toppra finds.

    Attributes:
        slowed: Whether that takes the time of the reference instead.
        integral: Pole of their integral part [1/s]; 0 for none.
    """

    slowed: bool
    integral: float = 0.0

    def run(self, lap: Lap, disturbance: tuple[str, ...]) -> RobotMotion:
        """Make a lap."""

        def make(station: RobotStation) -> JointServos:
            plan = lap.fastest.lasting(lap.moving) if self.slowed else lap.fastest
            samples = plan.sampled(lap.ticks, lap.period)
            robot, q_0 = station.part.belief.robot, start_posture(station)
            return JointServos(robot, _BANDWIDTH, samples, q_0, lap.period, self.integral)

        return under_law(lap.settings(disturbance), FOLDER, lap.duration, make)


def _gains(integral: str = "") -> str:
    own = f"{{poles: [-{_BANDWIDTH:g}, -{_BANDWIDTH:g}]{integral}}}"
    posture = "{poles: [-20, -20]}"
    return f"controller.gains.rigid={{eta: {own}, xi: {own}, phi: {own}, posture: {posture}}}"


_PLAIN = (_gains(),)
_OBSERVED = (_gains(", integral_pole: -10"), "controller.friction.source=observer")
_YIELDING = (
    *_OBSERVED,
    "compliance={transversal: {mass: {value: 5}, damping: {value: 110}, stiffness: {value: 600}}}",
)
_TRACKING = "controller.manifold=trajectory"
CONTESTANTS: Mapping[str, Contestant] = {
    "path following": OwnLaw(_PLAIN),
    "path following, observer": OwnLaw(_OBSERVED),
    "path following, yields, 600 N/m": OwnLaw(_YIELDING),
    "trajectory tracking": OwnLaw((*_PLAIN, _TRACKING)),
    "trajectory tracking, observer": OwnLaw((*_OBSERVED, _TRACKING)),
    "impedance, 600 N/m": Impedance(ImpedanceGains(600.0, 30.0, 1.0)),
    "impedance, 2000 N/m": Impedance(ImpedanceGains(2000.0, 100.0, 10.0, matched=True)),
    "joint servos, same time": Servos(slowed=True),
    "joint servos, integral": Servos(slowed=True, integral=10.0),
    "joint servos, Toppra": Servos(slowed=False),
}
