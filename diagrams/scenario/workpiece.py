"""Workpieces in contact with a tool: a surface or a notch, and the ball on the tool."""

import dataclasses as dc
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from pfsc_drake.checks import require
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import Numbers, Parameters, Range

SMALLEST, LARGEST = 1e-4, 10.0  # m, of workpiece and ball
_MODULUS = 1e3, 1e12  # Pa: softer than any foam, harder than any stone

# time step of a plant with contact
ContactStep = Annotated[float, Range(1e-5, 1e-3, "s")]


@dc.dataclass
class SoftBall(Parameters):
    """A ball with a soft shell.

    Attributes:
        radius: Radius, 1e-4 to 10 [m].
        modulus: Elasticity of the shell, pressure per relative depth [Pa].
        dissipation: Dissipation of Hunt and Crossley [s/m].
        friction: Coulomb coefficient between ball and workpiece.
        resolution: Edge length of the mesh for the contact, 1e-4 m or more.
    """

    radius: Annotated[float, Range(SMALLEST, LARGEST, "m, a positive number")] = 0.02
    modulus: Annotated[float, Range(*_MODULUS, "Pa; 4 MPa are 4e+06")] = 1e6
    dissipation: Annotated[float, Range(0.0, 1e6, "s/m")] = 1.0
    friction: Annotated[float, Range(0.0, 1e3)] = 0.2
    resolution: Annotated[float, Range(SMALLEST, LARGEST, "m, a positive number")] = 6e-3

    def stiffness(self, force: float) -> float:
        """Return the stiffness of the contact with a flat rigid body [N/m].

        The pressure in the ball grows with the depth, from zero at its surface to the modulus E in
        its centre. The force on a flat at depth d is ``F = pi E d^2 (1 - 2 d / (3 R))``, the
        integral of the pressure over the disc of contact, so that
        ``dF / dd = 2 pi E d (1 - d / R)``.

        Args:
            force: Contact force [N].
        """
        R, E = self.radius, self.modulus

        def missing(d: float) -> float:
            return float(np.pi * E * d**2 * (1.0 - 2.0 * d / (3.0 * R)) - force)

        # beyond half of the radius the slope falls again: the steepest is on the safe side
        deepest = R / 2.0
        d = deepest if missing(deepest) <= 0.0 else float(brentq(missing, 0.0, deepest))
        return float(2.0 * np.pi * E * d * (1.0 - d / R))


@dc.dataclass
class BallParameters(SoftBall):
    """A ball with a soft shell on the tool.

    A DELTA robot holds it by a gripper; gripper, ball and force/torque sensor are the load of
    the robot's parameters.

    Attributes:
        distance: Distance from the tool point down to the ball's centre [m]; 0 on robots that turn
            their tool.
    """

    distance: Annotated[float, Range(0.0, LARGEST, "m")] = 0.12


@dc.dataclass
class NotchParameters(Parameters):
    """A rigid workpiece with a round-bottomed notch, and the ball that runs in it.

    On the path the ball lies on the bottom of the notch of a workpiece in its taught pose.

    Attributes:
        ball: The ball.
        displacement: Displacement of the workpiece from its taught pose [m], world axes (z_0 down
            for DELTA robots).
        radius: Radius of the bottom [m], more than the ball's.
        depth: Depth from the rim to the bottom [m], not less than ``radius``.
        width: Width of the workpiece across the notch [m].
        time_step: Time step of the plant, a whole fraction of the controller's sampling time [s].
    """

    ball: BallParameters = dc.field(default_factory=BallParameters)
    displacement: Annotated[list[float], Numbers(3, Range(-LARGEST, LARGEST, "m"))] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    radius: Annotated[float, Range(SMALLEST, LARGEST, "m, a positive number")] = 0.022
    depth: Annotated[float, Range(SMALLEST, LARGEST, "m, a positive number")] = 0.025
    width: Annotated[float, Range(SMALLEST, LARGEST, "m, a positive number")] = 0.07
    time_step: ContactStep = 5e-4

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.radius > self.ball.radius, "radius", self.radius, "more than ball.radius")
        require(self.depth >= self.radius, "depth", self.depth, "radius or more")
        require(self.width > 2.0 * self.radius, "width", self.width, "more than twice the radius")

    @property
    def clearance(self) -> float:
        """Distance of the ball's centre from the notch's axis at contact with the bottom [m]."""
        return self.radius - self.ball.radius


_LARGEST_TURN = 45.0  # deg


@dc.dataclass
class WorkpieceParameters(Parameters):
    """A rigid workpiece under the scenario's surface, and the soft ball on the tool.

    The surface was taught with the tool point, the point of the ball that is nearest to the
    workpiece; the normal points out of the material.

    Attributes:
        ball: The ball, whose centre is its radius behind the tool point.
        shift: Shift of the workpiece from its taught pose [m], world axes.
        turn_zyx_deg: Turn of the workpiece about the middle of the surface since then [deg].
        spacing: Distance between the vertices of its mesh [m].
        time_step: Time step of the plant, a whole fraction of the controller's sampling time [s].
    """

    ball: SoftBall = dc.field(default_factory=SoftBall)
    shift: Annotated[list[float], Numbers(3, Range(-LARGEST, LARGEST, "m"))] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    turn_zyx_deg: Annotated[
        list[float], Numbers(3, Range(-_LARGEST_TURN, _LARGEST_TURN, "deg"))
    ] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    spacing: Annotated[float, Range(SMALLEST, LARGEST, "m, a positive number")] = 4e-3
    time_step: ContactStep = 5e-4
