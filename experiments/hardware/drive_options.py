"""What a controller allows itself on a robot, and by what it commands one."""

from dataclasses import dataclass

from diagrams.station import Station
from pfsc_drake.drivers.messages import ControlMode
from pfsc_drake.yaml.rules import Parameters, Positive

# after which a robot that is to stop is left alone, and how long it rests before [s]
LONGEST_STOP, RESTED = 2.0, 0.2
# a stop that makes the robot faster than this is none: a multiple of its speed, and more [rad/s]
FASTER, LEAST_SPEED = 1.5, 0.2
# beyond what a joint can move: a multiple of its speed, that of unknown ones, and noise
TWICE, FASTEST, LEAST_JUMP = 2.0, 10.0, 2e-3
# ticks that are missing for longer are none of a robot's: its clock was set [s]
LARGEST_GAP = 1.0
# where the reference remembers its own time and its pace
PACE = "reference_generator.pace"


@dataclass(frozen=True)
class DriveOptions(Parameters):
    """What a controller allows itself on a robot.

    Attributes:
        silence: How long no status may come [s].
        bridged: How many ticks may be missing in a row and are made up for.
        torque_rate: Largest rate of commanded torques, as drivers have it [Nm/s].
        effort_share: Largest share of a joint's effort limit.
    """

    silence: Positive = 0.1
    bridged: int = 10
    torque_rate: Positive = 1000.0
    effort_share: Positive = 0.95


def command_mode(station: Station) -> ControlMode:
    """Return what a station's law commands a robot by.

    Args:
        station: The station.
    """
    torques = station.law.linearization.relative_degree > 1
    return ControlMode.TORQUE if torques else ControlMode.VELOCITY
