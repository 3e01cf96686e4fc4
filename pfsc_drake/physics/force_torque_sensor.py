"""A six-axis force/torque sensor in a fixed joint between flange and tool."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.control.estimation.filters import LowPass
from pfsc_drake.errors import InputError

# ticks whose noise is known at once
NOISE_TICKS = 128


@dataclass
class ForceTorqueParameters:
    """Properties of a sensor; the first three entries are forces [N], the others torques [Nm].

    The defaults stand for a K6-D40 with 500 N and 20 Nm; noise and bandwidth of the
    amplifier are assumed.

    Attributes:
        measurement_range: Largest magnitude that is measured, shape (6,).
        bias: Reading without load, shape (6,).
        noise: Standard deviation of the white noise of one sample, shape (6,).
        bandwidth: Of the amplifier's first-order filter [Hz].
        seed: Of the noise.
        source: Where the numbers are from.
    """

    measurement_range: np.ndarray = field(default_factory=lambda: np.repeat([500.0, 20.0], 3))
    bias: np.ndarray = field(default_factory=lambda: np.zeros(6))
    noise: np.ndarray = field(default_factory=lambda: np.repeat([0.1, 0.004], 3))
    bandwidth: float = 200.0
    seed: int = 0
    source: str = "assumed"

    def __post_init__(self) -> None:
        _check("measurement_range", self.measurement_range, positive=True)
        _check("bias", np.abs(self.bias), positive=False)
        _check("noise", self.noise, positive=False)
        if self.seed < 0:
            raise InputError(f"seed = {self.seed}: must be zero or positive")


class ForceTorqueSensor(Block):
    """Measures the load that the tool puts on a fixed joint.

    With the joint's reaction force F on its child, from the plant, the reading is
    ``y_k = clip(lowpass(-F)_k + b + n_k)``. The sign is such that whoever pushes on the
    tool along x reads a positive ``f_x``, and that at rest the tool's weight is read;
    the tool's inertia is in it too. The sensor frame S is the joint's frame on its
    child, torques are about its origin.

    The filter (see :class:`LowPass`) and the noise advance once per period; in between
    the reading follows the load, so that nothing is delayed by the sampling. A NaN in
    the reaction comes out as NaN.

    The plant's reaction forces depend on the drive torques: between this block's
    output and the plant's inputs there must be a hold. In a discrete plant they are
    sampled and one of its steps old, unless it was told otherwise.

    Ports:
        reaction (input): F as ``[torque, force]`` in S, shape (6,), see :class:`JointReaction` and
            :class:`ToolReaction`.
        noise (input, optional): n of NOISE_TICKS ticks, one tick after the other, that of tick k
            at ``k mod NOISE_TICKS``, shape (6 NOISE_TICKS,), see :class:`SensorNoise`; zero if
            not connected.
        measured_wrench (output): ``[force, torque]`` in S, shape (6,) [N, Nm].
        load (output): ``-F``, what an ideal sensor would read, shape (6,) [N, Nm].

    State:
        The ``filter``; it rests on the load where it is not finite, as before the first tick.

    Args:
        parameters: The sensor's properties.
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth is too large for the period.
    """

    expands = False  # noise is looked up

    def __init__(self, parameters: ForceTorqueParameters, period: float) -> None:
        self._parameters, self._low_pass = parameters, LowPass(parameters.bandwidth, period)
        self.inputs = {
            "reaction": Port(6, "Nm, N"),
            "noise": Port(6 * NOISE_TICKS, "N, Nm", optional=True),
        }
        self.outputs = {"measured_wrench": Port(6, "N, Nm"), "load": Port(6, "N, Nm")}
        self.states = {"filter": 6}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"filter": ca.DM.nan(6)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        limit = ca.DM(self._parameters.measurement_range)
        load = -ca.vertcat(u.reaction[3:], u.reaction[:3])
        filtered = self._low_pass.output(self._at_rest(x, load), load)
        reading = filtered + ca.DM(self._parameters.bias) + self._noise(u, t)
        # unlike a minimum, a comparison lets NaN through
        reading = where(reading > limit, limit, reading)
        return {"measured_wrench": where(reading < -limit, -limit, reading), "load": load}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"filter": self._low_pass.update(self._at_rest(x, y.load), y.load)}

    def _at_rest(self, x: Values, load: Any) -> Any:
        return where(is_finite(x.filter), x.filter, self._low_pass.rest(load))

    def _noise(self, u: Values, t: Any) -> Any:
        if u.noise is None:
            return 0.0
        return ca.reshape(u.noise, 6, NOISE_TICKS)[:, ca.fmod(t, NOISE_TICKS)]


def _check(key: str, value: np.ndarray, *, positive: bool) -> None:
    value = np.asarray(value, dtype=float)
    fits = value.shape == (6,) and np.all(np.isfinite(value))
    if not (fits and np.all(value > 0.0 if positive else value >= 0.0)):
        allowed = "positive" if positive else "finite, not negative"
        raise InputError(f"{key} = {value.tolist()}: must be 6 {allowed} numbers")
