"""Six-axis force/torque sensor in a fixed joint between flange and tool, and its failures."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.control.estimation.filters import LowPass
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad, predicted_load
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import Numbers, Parameters, Range, Seed

# ticks in a block of noise
NOISE_TICKS = 128


@dataclass
class ForceTorqueParameters(Parameters):
    """Properties of a sensor; the first three entries are forces [N], the others torques [Nm].

    In YAML two numbers denote equal forces and equal torques, one number six equal entries. The
    defaults describe a K6-D40 with 500 N and 20 Nm; noise and bandwidth of the
    amplifier are assumed.

    Attributes:
        measurement_range: Largest magnitude that is measured, shape (6,) [N, Nm].
        bias: Reading without load, shape (6,) [N, Nm].
        noise: Standard deviation of the white noise of one sample, shape (6,) [N, Nm].
        bandwidth: Bandwidth of the amplifier's first-order filter [Hz].
        seed: Seed of the noise.
    """

    measurement_range: Annotated[np.ndarray, Numbers(6, Range(0.0, open=True))] = field(
        default_factory=lambda: np.repeat([500.0, 20.0], 3), metadata=equal(6, parts=2)
    )
    bias: Annotated[np.ndarray, Numbers(6)] = field(
        default_factory=lambda: np.zeros(6), metadata=equal(6, parts=2)
    )
    noise: Annotated[np.ndarray, Numbers(6, Range(0.0))] = field(
        default_factory=lambda: np.repeat([0.1, 0.004], 3), metadata=equal(6, parts=2)
    )
    bandwidth: float = 200.0
    seed: Seed = 0


class ForceTorqueSensor(Block):
    """Measures the load of the tool on a fixed joint.

    With the joint's reaction force F on its child, from the plant, the reading is
    ``y_k = clip(lowpass(-F)_k + b + n_k)``. A force on the tool along x has a positive reading
    ``f_x``; at rest the reading is the tool's weight; in motion it contains the tool's inertial
    load. The sensor frame S is the joint's frame on its child, torques are about its origin.

    The filter (see :class:`LowPass`) and the noise advance once per period; in between
    the reading follows the load, so that sampling causes no delay. A NaN in the reaction causes a
    NaN reading.

    The plant's reaction forces depend on the drive torques: between this block's output and the
    plant's inputs there must be a hold. In a discrete plant they are sampled and one step old by
    default.

    Ports:
        reaction (input): F as ``[torque, force]`` in S, shape (6,), see :class:`JointReaction` and
            :class:`ToolReaction`.
        noise (input, optional): n of NOISE_TICKS consecutive ticks, tick k at index
            ``k mod NOISE_TICKS``, shape (6 NOISE_TICKS,), see :class:`SensorNoise`; zero if
            not connected.
        measured_wrench (output): ``[force, torque]`` in S, shape (6,) [N, Nm].
        load (output): ``-F``, the reading of an ideal sensor, shape (6,) [N, Nm].

    State:
        The ``filter``; it rests on the load if NaN or infinite, as before the first tick.

    Args:
        parameters: The sensor's properties.
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth is too large for the period.
    """

    expands = False  # noise is a table

    def __init__(self, parameters: ForceTorqueParameters, period: float) -> None:
        self._parameters, self._low_pass = parameters, LowPass(parameters.bandwidth, period)
        self.inputs = {
            "reaction": Port(6, "Nm, N"),
            "noise": Port(6 * NOISE_TICKS, "N, Nm", optional=True),
        }
        self.outputs = {"measured_wrench": Port(6, "N, Nm"), "load": Port(6, "N, Nm")}
        self.states = {"filter": 6}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"filter": ca.DM.nan(6)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        limit = ca.DM(self._parameters.measurement_range)
        load = -ca.vertcat(u.reaction[3:], u.reaction[:3])
        filtered = self._low_pass.output(self._at_rest(x, load), load)
        reading = filtered + ca.DM(self._parameters.bias) + noise_at(u.noise, 6, t)
        # unlike a minimum, a comparison lets NaN through
        reading = where(reading > limit, limit, reading)
        return {"measured_wrench": where(reading < -limit, -limit, reading), "load": load}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"filter": self._low_pass.update(self._at_rest(x, y.load), y.load)}

    def _at_rest(self, x: Values, load: Any) -> Any:
        return where(is_finite(x.filter), x.filter, self._low_pass.rest(load))


def noise_at(noise: Any | None, size: int, t: Any) -> Any:
    """Return the noise of a tick, shape (size,); 0 without any.

    Args:
        noise: Noise of NOISE_TICKS consecutive ticks, shape (size NOISE_TICKS,), or None.
        size: Number of components.
        t: Number of the tick.
    """
    if noise is None:
        return 0.0
    return ca.reshape(noise, size, NOISE_TICKS)[:, ca.fmod(t, NOISE_TICKS)]


FailureKind = Literal["nan", "frozen", "jump"]
KINDS = ("nan", "frozen", "jump")


class SensorFailure(Block):
    """Passes a measurement through until components fail.

    Ports:
        measured (input): Any vector, shape (size,).
        delivered (output): The measurement; from ``time`` on, the failing components are NaN,
            constant at their last values, or in error by ``jump``.

    State:
        Of kind ``frozen``: measurement at the ``last`` tick before the failure.

    Args:
        size: Size of the measurement.
        indices: Indices of the failing components.
        time: Time of the failure [s].
        period: Sampling time [s].
        kind: Kind of failure: ``nan``, ``frozen`` or ``jump``.
        jump: Error of components that jump.

    Raises:
        InputError: If the kind is unknown.
    """

    def __init__(
        self,
        size: int,
        indices: list[int],
        time: float,
        period: float,
        kind: str = "nan",
        jump: float = 0.0,
    ) -> None:
        if kind not in KINDS:
            raise InputError(f"kind of a sensor's failure: {kind!r}; must be {', '.join(KINDS)}")
        self._fails = np.zeros(size)
        self._fails[indices] = 1.0
        self._time, self._period, self._kind, self._jump = time, period, kind, jump
        self.inputs, self.outputs = {"measured": Port(size)}, {"delivered": Port(size)}
        self.states = {"last": size} if kind == "frozen" else {}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"last": u.measured} if self.states else {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        wrong = u.measured + self._jump
        if self._kind == "nan":
            wrong = np.nan
        elif self._kind == "frozen":
            wrong = x.last
        return {"delivered": where(ca.DM(self._fails) * self._has_failed(t), wrong, u.measured)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"last": where(self._has_failed(t), x.last, u.measured)} if self.states else {}

    def _has_failed(self, t: Any) -> Any:
        return t * self._period >= self._time


def tool_reaction_function(robot: RobotModel, load: ToolLoad) -> ca.Function:
    """Return the reaction function of the joint between flange and tool.

    By Newton-Euler equations of the tool alone: the opposite of :func:`predicted_load` and of the
    wrench that acts on the tool, shifted to the sensor's origin.

    Args:
        robot: The robot.
        load: Everything behind the sensor.

    Returns:
        ``(q, v, a, wrench) -> reaction``: link coordinates, velocities, accelerations, each
        (N,); wrench ``[force, torque]`` at the tool point in world axes, shape (6,); reaction
        ``[torque, force]`` on the tool in S, shape (6,) [Nm, N].
    """
    n = robot.dimension
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    wrench = ca.SX.sym("wrench", 6)
    joints = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(n)]
    predicted, R_WS = predicted_load(robot, load, joints)
    force, torque = R_WS.T @ wrench[:3], R_WS.T @ wrench[3:]
    total = predicted + ca.vertcat(force, torque + ca.cross(ca.SX(load.p_ST), force))
    reaction = -ca.vertcat(total[3:], total[:3])
    return ca.Function(
        "tool_reaction",
        [q, v, a, wrench],
        ca.cse([ca.densify(reaction)]),
        ["q", "v", "a", "wrench"],
        ["reaction"],
    )
