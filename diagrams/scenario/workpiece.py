"""What a tool presses on or runs in, and the ball that it touches with."""

import dataclasses as dc

import numpy as np
from scipy.optimize import brentq

from diagrams.scenario.checks import require, require_between, require_numbers
from pfsc_drake.yaml.fields import equal

SMALLEST, LARGEST = 1e-4, 10.0  # m, of workpiece and ball
_MODULUS = 1e3, 1e12  # Pa: softer than any foam, harder than any stone
STEPS = (1e-5, 1e-3)  # s, of a plant with contact


@dc.dataclass
class SoftBall:
    """A ball with a soft shell.

    Attributes:
        radius: Radius, 1e-4 to 10 [m].
        modulus: Elasticity of the shell, pressure per relative depth [Pa].
        dissipation: Dissipation of Hunt and Crossley [s/m].
        friction: Coulomb coefficient between ball and workpiece.
        resolution: Edge length of the mesh that contact is computed with, 1e-4 m or more.
    """

    radius: float = 0.02
    modulus: float = 1e6
    dissipation: float = 1.0
    friction: float = 0.2
    resolution: float = 6e-3

    def __post_init__(self) -> None:
        for key in ("radius", "resolution"):
            require_between(key, getattr(self, key), SMALLEST, LARGEST, "m, a positive number")
        require_between("modulus", self.modulus, *_MODULUS, "Pa; 4 MPa are 4e+06")
        for key, most in {"dissipation": 1e6, "friction": 1e3}.items():
            require_up_to(key, getattr(self, key), most)

    def stiffness(self, force: float) -> float:
        """Return by how much the force on a flat rigid body grows with the depth [N/m].

        The pressure in the ball grows with the depth, from zero at its skin to the modulus E in
        its centre. A flat at depth d bears ``F = pi E d^2 (1 - 2 d / (3 R))``, the pressure's
        integral over the disc that is touched, so that ``dF / dd = 2 pi E d (1 - d / R)``.

        Args:
            force: That it bears there [N].
        """
        R, E = self.radius, self.modulus

        def missing(d: float) -> float:
            return float(np.pi * E * d**2 * (1.0 - 2.0 * d / (3.0 * R)) - force)

        # from half of the way on the slope falls again: the steepest is on the safe side
        deepest = R / 2.0
        d = deepest if missing(deepest) <= 0.0 else float(brentq(missing, 0.0, deepest))
        return float(2.0 * np.pi * E * d * (1.0 - d / R))


def require_up_to(key: str, value: float, most: float) -> None:
    """Refuse what is negative or too large.

    Args:
        key: Name, for the message.
        value: What was given.
        most: Largest number that is allowed.

    Raises:
        InputError: If so.
    """
    require(0.0 <= value <= most, key, value, f"zero or a positive number, at most {most:g}")


def require_contact_step(time_step: float) -> None:
    """Refuse the step of a plant with contact [s].

    Raises:
        InputError: If contact cannot be computed with it.
    """
    shortest, longest = STEPS
    allowed = f"{shortest:g} to {longest:g} s"
    require(shortest <= time_step <= longest, "time_step", time_step, allowed)


@dc.dataclass
class BallParameters(SoftBall):
    """A ball with a soft shell on the tool.

    A DELTA robot holds it by a gripper; gripper, ball and force/torque sensor are the load of
    the robot's parameters.

    Attributes:
        distance: From the tool point down to the ball's centre [m]; 0 on robots that turn
            their tool.
    """

    distance: float = 0.12

    def __post_init__(self) -> None:
        super().__post_init__()
        require_up_to("distance", self.distance, LARGEST)


@dc.dataclass
class NotchParameters:
    """A rigid workpiece with a round-bottomed notch, and the ball that runs in it.

    The path is where the tool point is when the ball lies on the bottom of the notch of a
    workpiece that stands where it stood when the path was taught.

    Attributes:
        ball: The ball.
        displacement: Displacement of the workpiece since then [m], world axes (z_0 down for DELTA
            robots).
        radius: Radius of the bottom [m], more than the ball's.
        depth: From the rim down to the bottom [m], not less than ``radius``.
        width: Width of the workpiece across the notch [m].
        time_step: Time step of the plant, a whole fraction of the controller's sampling time [s].
    """

    ball: BallParameters = dc.field(default_factory=BallParameters)
    displacement: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    radius: float = 0.022
    depth: float = 0.025
    width: float = 0.07
    time_step: float = 5e-4

    def __post_init__(self) -> None:
        require_numbers("displacement", self.displacement, 3)
        near = max(map(abs, self.displacement)) <= LARGEST
        require(near, "displacement", self.displacement, f"3 numbers of at most {LARGEST:g} m")
        for key in ("radius", "depth", "width"):
            require_between(key, getattr(self, key), SMALLEST, LARGEST, "m, a positive number")
        require(self.radius > self.ball.radius, "radius", self.radius, "more than ball.radius")
        require(self.depth >= self.radius, "depth", self.depth, "radius or more")
        require(self.width > 2.0 * self.radius, "width", self.width, "more than twice the radius")
        require_contact_step(self.time_step)

    @property
    def clearance(self) -> float:
        """From the bottom up to where the ball touches nothing, the notch's axis [m]."""
        return self.radius - self.ball.radius


_LARGEST_TURN = 45.0  # deg


@dc.dataclass
class WorkpieceParameters:
    """A rigid workpiece under the scenario's surface, and the soft ball on the tool.

    The surface was taught with the tool point, where the ball is nearest to the workpiece, on it;
    the material is on the side that the normal points away from.

    Attributes:
        ball: The ball, whose centre is its radius behind the tool point.
        shift: Shift of the workpiece since it was taught [m], world axes.
        turn_zyx_deg: How it turned about the middle of the surface since then [deg].
        spacing: Between the vertices of its mesh [m].
        time_step: Time step of the plant, a whole fraction of the controller's sampling time [s].
    """

    ball: SoftBall = dc.field(default_factory=SoftBall)
    shift: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    turn_zyx_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    spacing: float = 4e-3
    time_step: float = 5e-4

    def __post_init__(self) -> None:
        for key in ("shift", "turn_zyx_deg"):
            require_numbers(key, getattr(self, key), 3)
        near = max(map(abs, self.shift)) <= LARGEST
        require(near, "shift", self.shift, f"3 numbers of at most {LARGEST:g} m")
        small = max(map(abs, self.turn_zyx_deg)) <= _LARGEST_TURN
        allowed = f"3 numbers of at most {_LARGEST_TURN:g} deg"
        require(small, "turn_zyx_deg", self.turn_zyx_deg, allowed)
        require_between("spacing", self.spacing, SMALLEST, LARGEST, "m, a positive number")
        require_contact_step(self.time_step)
