"""Controller of a robot along an excitation: PD with feed-forward, at 1 kHz."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain, Sine, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.serial.rigid_rotors import rigid_mass_matrix, rigid_torque_function

# postures along a motion for the evaluation of inertias
_POSTURES = 50


@dataclass(frozen=True)
class Servo:
    """A position controller for each joint, as in industrial robots.

    ``tau_d = sat(tau_ff + K_p (q_d - q) + K_d (q_d' - q'))`` with ``K_p = J omega^2``,
    ``K_d = 2 zeta J omega`` for the least inertia J at a drive, and the feed-forward torque
    ``tau_ff`` of a rigid robot with friction, ``f_c sign(q_d') + f_v q_d'``. The feedback acts at
    the ticks and is held in between, on the difference quotient of the encoder's positions; the
    drives interpolate ``tau_ff`` between the ticks.

    Without feed-forward of friction the robot sticks at every reversal until the deviation has
    grown by ``2 f_c / K_p``. The motion then has edges, which the bandwidth of
    :func:`~identification.measurement.periods.average` removes, and parameters of light joints with
    much friction are biased.

    Attributes:
        bandwidth: ``omega`` [rad/s].
        damping: ``zeta``.
        feedforward: Weight of the rigid robot's torque: 1 for the full torque, 0 for none.
        friction: Weight of the friction torque: 1 for its usual value, 0 for none.
        period: Sampling time [s].

    Raises:
        InputError: If a value is out of range.
    """

    bandwidth: float = 150.0
    damping: float = 0.8
    feedforward: float = 1.0
    friction: float = 1.0
    period: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("bandwidth", "damping", "period"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise InputError(f"servo: {name} = {getattr(self, name)}; must be positive")
        for name in ("feedforward", "friction"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise InputError(f"servo: {name} = {getattr(self, name)}; must be 0 or positive")
        if 2.0 * self.damping * self.bandwidth * self.period > 0.5:
            raise InputError(
                f"servo: bandwidth = {self.bandwidth:g} rad/s; must be at most "
                f"{0.25 / (self.damping * self.period):g} rad/s at a period of {self.period:g} s"
            )

    def gains(self, inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ``K_p`` and ``K_d``, each (N,).

        Args:
            inertia: ``J`` [kg m^2 or kg], shape (N,).
        """
        return inertia * self.bandwidth**2, 2.0 * self.damping * inertia * self.bandwidth


def drive_inertia(subject: Subject, q: np.ndarray) -> np.ndarray:
    """Return the least inertia at each drive along a motion, shape (N,) [kg m^2 or kg].

    It is the inertia with all other joints free, ``1 / (D^-1)_ii``.

    Args:
        subject: The robot.
        q: Joint coordinates along the motion, shape (K, N).
    """
    x = ca.SX.sym("q", subject.dimension)
    if subject.chain is None:
        D = subject.robot.mass_matrix(x)
    else:
        D = rigid_mass_matrix(subject.chain, subject.mounts, x)
    function = ca.Function("D", [x], [ca.densify(D)])
    postures = q[:: max(1, len(q) // _POSTURES)]
    compliance = [np.diag(np.linalg.inv(np.array(function(posture)))) for posture in postures]
    return 1.0 / np.max(compliance, axis=0)


def friction_torques(v: np.ndarray, coulomb: np.ndarray, viscous: np.ndarray) -> np.ndarray:
    """Return the torques ``f_c sign(v) + f_v v`` against friction, shape (K, N) [Nm or N].

    Args:
        v: Velocities, shape (K, N).
        coulomb: ``f_c`` [Nm or N], shape (N,).
        viscous: ``f_v`` [Nm s/rad or N s/m], shape (N,).
    """
    return coulomb * np.sign(v) + viscous * v


def rigid_torques(subject: Subject, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the drive torques of the robot without friction, shape (K, N) [Nm or N].

    Args:
        subject: The robot.
        q: Joint coordinates, shape (K, N).
        v: Their velocities, shape (K, N).
        a: Their accelerations, shape (K, N).
    """
    if subject.chain is None:
        n = subject.dimension
        x = [ca.SX.sym(name, n) for name in "qva"]
        jets = [Jet.from_derivatives([d[i] for d in x]) for i in range(n)]
        tau = ca.vertcat(*[t.coefficients[0] for t in subject.robot.inverse_dynamics(jets)])
        function = ca.Function("torque", x, [ca.densify(tau)])
    else:
        function = rigid_torque_function(subject.chain, subject.mounts)
    return np.array(function(q.T, v.T, a.T)).T


_APART = 1e-9  # s, least distance of two changes


def add_samples(
    builder: DiagramBuilder, name: str, t: np.ndarray, values: np.ndarray
) -> OutputPort:
    """Return a source of values that are held from their instants on.

    Args:
        builder: Builder of the diagram.
        name: Name of the source.
        t: Evenly spaced instants [s], shape (K,).
        values: Shape (K, n).
    """
    # the last value of such a trajectory only ends it
    ends = np.append(t, 2.0 * t[-1] - t[-2])
    trajectory = PiecewisePolynomial.ZeroOrderHold(ends, np.vstack([values, values[-1]]).T)
    return builder.AddNamedSystem(name, TrajectorySource(trajectory)).get_output_port()


def add_curves(builder: DiagramBuilder, name: str, t: np.ndarray, values: np.ndarray) -> OutputPort:
    """Return a source of values interpolated by cubic polynomials.

    Args:
        builder: Builder of the diagram.
        name: Name of the source.
        t: Instants [s], shape (K,).
        values: Shape (K, n).
    """
    slopes = np.gradient(values, t, axis=0)
    curves = PiecewisePolynomial.CubicHermite(t, values.T, slopes.T)
    return builder.AddNamedSystem(name, TrajectorySource(curves)).get_output_port()


def add_signs(
    builder: DiagramBuilder, name: str, t: np.ndarray, v: np.ndarray, size: np.ndarray
) -> OutputPort:
    """Return a source of ``size sign(v)`` that changes at the zeros of ``v``, between the instants.

    Args:
        builder: Builder of the diagram.
        name: Name of the source.
        t: Instants [s], shape (K,).
        v: Shape (K, n).
        size: Shape (n,).
    """
    changes = [t[[0, -1]]]
    for column in v.T:
        k = np.flatnonzero(column[1:] * column[:-1] < 0.0)
        part = column[k] / (column[k] - column[k + 1])
        changes.append(t[k] + part * (t[k + 1] - t[k]))
    breaks = np.unique(np.concatenate(changes))
    far = np.diff(breaks, prepend=-np.inf) > _APART
    breaks = breaks[far]
    middles = 0.5 * (breaks[1:] + breaks[:-1])
    signs = np.sign([np.interp(middles, t, column) for column in v.T]) * size[:, None]
    trajectory = PiecewisePolynomial.ZeroOrderHold(breaks, np.hstack([signs, signs[:, -1:]]))
    return builder.AddNamedSystem(name, TrajectorySource(trajectory)).get_output_port()


def add_sines(
    builder: DiagramBuilder,
    name: str,
    amplitude: np.ndarray,
    frequency: np.ndarray,
    phase: np.ndarray,
) -> OutputPort:
    """Return a source of sums of sines, ``sum_m A_im sin(w_im t + p_im)``, shape (N,).

    Args:
        builder: Builder of the diagram.
        name: Name of the sum.
        amplitude: A, shape (N, M).
        frequency: w [rad/s], shape (N, M).
        phase: p [rad], shape (N, M).
    """
    source = Sine(amplitude.ravel(), frequency.ravel(), phase.ravel(), is_time_based=True)
    sines = builder.AddNamedSystem(f"{name}_parts", source)
    rows = np.kron(np.eye(len(amplitude)), np.ones(amplitude.shape[1]))
    total = builder.AddNamedSystem(name, MatrixGain(rows))
    builder.Connect(sines.get_output_port(0), total.get_input_port())
    return total.get_output_port()


def add_sum(
    builder: DiagramBuilder, name: str, first: OutputPort, second: OutputPort
) -> OutputPort:
    """Return the sum of two signals of the same size.

    Args:
        builder: Builder of the diagram.
        name: Name of the sum.
        first: Shape (n,).
        second: Shape (n,).
    """
    adder = builder.AddNamedSystem(name, Adder(2, first.size()))
    builder.Connect(first, adder.get_input_port(0))
    builder.Connect(second, adder.get_input_port(1))
    return adder.get_output_port()
