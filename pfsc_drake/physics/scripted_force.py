"""Scripted forces on the tool as functions of time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, where
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.path import PathManifold, path_coordinates
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.yaml.rules import OneOf, Parameters

FRAMES = ("world", "manifold")


def smooth_step(x: Any) -> Any:
    """Return ``10 x^3 - 15 x^4 + 6 x^5``, 0 before x = 0 and 1 after x = 1; C^2."""
    x = ca.fmin(ca.fmax(x, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


def smooth_step_slope(x: Any) -> Any:
    """Return the derivative of :func:`smooth_step`."""
    x = ca.fmin(ca.fmax(x, 0.0), 1.0)
    return 30.0 * x * x * (1.0 - x) * (1.0 - x)


def smooth_pulse(time: Any, begin: float, end: float, ramp: float) -> Any:
    """Return 1 from ``begin + ramp`` to ``end - ramp``, 0 outside ``begin .. end``; C^2."""
    return ca.fmin(smooth_step((time - begin) / ramp), smooth_step((end - time) / ramp))


def require_vector(key: str, value: np.ndarray) -> np.ndarray:
    """Return three numbers as an array, shape (3,).

    Args:
        key: Name in the message.
        value: Values to check.

    Raises:
        InputError: If they are not 3 finite numbers.
    """
    vector = np.asarray(value, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise InputError(f"{key} = {vector.tolist()}: must be 3 finite numbers")
    return vector


@dataclass
class ForcePulse(Parameters):
    """A smooth pulse of a wrench on the robot (C^2 in time).

    Attributes:
        begin: Begin of the pulse [s].
        end: End of the pulse [s].
        force: Force of the plateau, shape (3,) [N].
        torque: Torque of the plateau, shape (3,) [Nm].
        ramp: Duration of rise and of fall [s].
        frame: ``world``: components along the world's axes; ``manifold``: along
            ``e_par, e_perp, e_cross`` of the path next to the tool, so that
            ``force = [-100, 0, 0]`` pushes against a motion with growing ``eta``.
        link: Link or frame of the robot's model that it acts on; empty for the tool.
        point: Point of action in the axes of that link or frame [m], shape (3,).
    """

    begin: float = 0.0
    end: float = 1.0
    force: np.ndarray = field(default_factory=lambda: np.zeros(3))
    torque: np.ndarray = field(default_factory=lambda: np.zeros(3))
    ramp: float = 0.05
    frame: Annotated[str, OneOf(FRAMES)] = "world"
    link: str = ""
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("force", "torque", "point"):
            setattr(self, key, require_vector(key, getattr(self, key)))
        if not self.link and self.point.any():
            raise InputError(f"point = {self.point.tolist()}: must be [0, 0, 0] without a link")
        if not (np.isfinite(self.begin) and self.begin < self.end < np.inf):
            raise InputError(
                f"begin, end = {self.begin}, {self.end}; allowed: finite numbers [s], begin "
                "before end"
            )
        longest = (self.end - self.begin) / 2.0
        if not 0.0 < self.ramp <= longest * (1.0 + 1e-9):
            raise InputError(
                f"ramp = {self.ramp}: must be positive and at most {longest:g}, half the pulse"
            )

    def at(self, time: Any) -> Any:
        """Return ``[force, torque]`` in the pulse's own frame, shape (6,) [N, Nm].

        Args:
            time: [s].
        """
        scale = smooth_pulse(time, self.begin, self.end, self.ramp)
        return scale * ca.DM(np.concatenate([self.force, self.torque]))


class ForceProfile:
    """A sum of pulses at one point.

    Args:
        pulses: The pulses; they may overlap and are added.
    """

    def __init__(self, pulses: Sequence[ForcePulse]) -> None:
        self._by_frame = {
            frame: [pulse for pulse in pulses if pulse.frame == frame] for frame in FRAMES
        }

    @property
    def needs_manifold(self) -> bool:
        """Whether a pulse is in manifold coordinates."""
        return bool(self._by_frame["manifold"])

    def at(self, time: Any, axes: Any) -> Any:
        """Return the wrench in world axes, shape (6,) [N, Nm].

        Args:
            time: [s].
            axes: Directions of the frame ``manifold`` as columns, shape (3, 3).
        """
        sums = {
            frame: ca.reshape(sum((p.at(time) for p in pulses), ca.DM.zeros(6)), 3, 2)
            for frame, pulses in self._by_frame.items()
        }
        return ca.vec(sums["world"] + axes @ sums["manifold"])


_LOOKS_BEFORE = 0.1  # s


class DecoupledForce(Block):
    """A pulse of the wrench of :func:`decoupled_force_function`.

    The wrench's direction is computed at the last tick; its magnitude is a smooth function of time.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): Projection of the tool onto the path.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        Normalized wrench (``unit``), updated during the pulse and shortly before.

    Args:
        robot: A robot with six axes.
        manifold: A path with orientation.
        pulse: ``begin, end, ramp`` [s] and ``force`` along the tangent [N].
        period: Sampling time [s].
    """

    expands = False  # the expression of the wrench is long and rarely needed

    def __init__(
        self,
        robot: RobotModel,
        manifold: PathManifold,
        pulse: tuple[float, float, float, float],
        period: float,
    ) -> None:
        self._begin, self._end, self._ramp, self._force = pulse
        self._size, self._period = robot.dimension, period
        self._wrench = decoupled_force_function(robot, manifold)
        self.inputs = {
            "joint_state": Port(4 * robot.dimension, "rad, rad/s or m, m/s"),
            "manifold_point": Port(manifold.layout.size),
        }
        self.outputs, self.states = {"wrench": Port(6, "N, Nm")}, {"unit": 6}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        pulse = smooth_pulse(t * self._period, self._begin, self._end, self._ramp)
        return {"wrench": self._force * pulse * x.unit}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        time, q = t * self._period, u.joint_state[: self._size]
        near = all_of(time >= self._begin - _LOOKS_BEFORE, time <= self._end)
        unit = ca.if_else(near, self._wrench(q, u.manifold_point), x.unit, True)
        return {"unit": where(all_finite(unit), unit, x.unit)}


def decoupled_force_function(robot: RobotModel, manifold: PathManifold) -> ca.Function:
    """Return the wrench whose effect on the slow dynamics (3.68) is along ``eta`` alone.

    An external wrench w accelerates the virtual output by ``A (D_E + D_M)^-1 J_g' w``.
    A force along the tangent moves the other coordinates too, due to the arm's inertia;
    this wrench moves ``eta`` only, and its force along the tangent is 1 N.

    Args:
        robot: A robot with six axes.
        manifold: A path with orientation.

    Returns:
        CasADi function ``(q, manifold_point) -> [force, torque]`` at the tool point, world
        axes, shapes (6,), (size,) and (6,).
    """
    n = robot.dimension
    q, rate = ca.SX.sym("q", n), ca.SX.sym("rate", n)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    path = manifold.geometry(point)
    y, R_e = robot.tool_pose(joint_jets([q, rate]))
    output = path_coordinates(y, R_e, path)
    A = ca.jacobian(ca.vertcat(*[x.coefficients[1] for x in output]), rate)
    spin = R_e.coefficients[1] @ R_e.coefficients[0].T
    twist = ca.vertcat(y.coefficients[1], ca.inv_skew(spin))
    J_g = ca.jacobian(twist, rate)
    tau = (robot.mass_matrix(q) + ca.diag(robot.D_M)) @ ca.solve(A, ca.SX.eye(n)[:, 0])
    wrench = ca.solve(J_g.T, tau)
    tangent = path.position[1] / ca.norm_2(path.position[1])
    wrench = wrench / ca.dot(wrench[:3], tangent)
    return ca.Function("decoupled_force", [q, point], [ca.densify(wrench)])


class ScriptedForce(Block):
    """Force and torque at the tool point over time, see :class:`ForcePulse`.

    The wrench is evaluated at the tick. Directions in manifold coordinates are the axes at the
    manifold point of the last tick; they are unchanged if the point is NaN or infinite.

    Ports:
        manifold_point (input): Projection of the tool onto the manifold; only if a pulse is in
            manifold coordinates.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        The manifold's ``axes`` as stacked columns, if they are needed; zero before the first
        point.

    Args:
        profile: The profile.
        manifold: The manifold that the tool follows.
        period: Sampling time [s].
    """

    def __init__(self, profile: ForceProfile, manifold: Manifold, period: float) -> None:
        self._profile, self._manifold, self._period = profile, manifold, period
        self.inputs, self.states = {}, {}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        if profile.needs_manifold:
            self.inputs["manifold_point"] = Port(manifold.layout.size)
            self.states["axes"] = 9

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return self._axes_state(u, ca.DM.zeros(9)) if self.states else {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        axes = ca.reshape(x.axes, 3, 3) if self.states else ca.DM.zeros(3, 3)
        return {"wrench": self._profile.at(t * self._period, axes)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return self._axes_state(u, x.axes) if self.states else {}

    def _axes_state(self, u: Values, before: Any) -> dict[str, Any]:
        axes = ca.vec(self._manifold.axes(u.manifold_point))
        return {"axes": where(all_finite(axes), axes, before)}
