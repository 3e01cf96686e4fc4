"""A six-axis force/torque sensor in a fixed joint of a MultibodyPlant."""

import math
from dataclasses import dataclass, field

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, WeldJoint
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.control.tool_load import LowPass
from pfsc_drake.errors import InputError

# ticks whose noise is drawn at once
_BLOCK = 64


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


class ForceTorqueSensor(LeafSystem):
    """Measures the load that the tool puts on a fixed joint.

    With the joint's reaction force F on its child, from the plant, the reading is
    ``y_k = clip(lowpass(-F)_k + b + n_k)``. The sign is such that whoever pushes on the
    tool along x reads a positive ``f_x``, and that at rest the tool's weight is read;
    the tool's inertia is in it too. The sensor frame S is the joint's frame on its
    child, torques are about its origin.

    The filter (see :class:`LowPass`) and the noise advance once per period; in between
    the reading follows the load, so that nothing is delayed by the sampling. A NaN in
    the reaction comes out as NaN.

    The plant's reaction forces depend on the drive torques: between this system's
    output and the plant's inputs there must be a hold. In a discrete plant they are
    sampled and one of its steps old, unless it was told otherwise.

    Ports:
        reaction_forces (input): The plant's reaction forces, abstract.
        measured_wrench (output): ``[force, torque]`` in S, shape (6,) [N, Nm].
        load (output): ``-F``, what an ideal sensor would read, shape (6,) [N, Nm].

    State:
        Discrete: state of the filter, shape (6,), NaN before the first tick; noise of a
        block of ticks, shape (64, 6) by rows; number of the tick, shape (1,). The noise of
        tick k depends on seed and k alone.

    Args:
        plant: A finalized plant.
        joint: The joint with the sensor in it.
        parameters: The sensor's properties.
        period: Sampling time [s].

    Raises:
        InputError: If the joint is not fixed or the bandwidth is too large for the period.
    """

    def __init__(
        self, plant: MultibodyPlant, joint: Joint, parameters: ForceTorqueParameters, period: float
    ) -> None:
        super().__init__()
        if not isinstance(joint, WeldJoint):
            raise InputError(
                f"joint '{joint.name()}' of the force/torque sensor: type '{joint.type_name()}'; "
                "must be a fixed joint"
            )
        # reactions are numbered without gaps, also where joints were removed
        self._joint = list(plant.GetJointIndices()).index(joint.index())
        self._parameters = parameters
        self._low_pass = LowPass(parameters.bandwidth, period)
        self._filter = self.DeclareDiscreteState(np.full(6, np.nan))
        self._noise = self.DeclareDiscreteState(self._draw(0))
        self._tick = self.DeclareDiscreteState(1)
        self._reactions = self.DeclareAbstractInputPort(
            "reaction_forces", Value[list[SpatialForce]]()
        )
        states = (self._filter, self._noise, self._tick)
        self.DeclareVectorOutputPort(
            "measured_wrench",
            6,
            self._calc_measured_wrench,
            prerequisites_of_calc={
                self._reactions.ticket(),
                *(self.discrete_state_ticket(state) for state in states),
            },
        )
        self._load = self.DeclareVectorOutputPort(
            "load", 6, self._calc_load, prerequisites_of_calc={self._reactions.ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _draw(self, block: int) -> np.ndarray:
        random = np.random.default_rng((self._parameters.seed, block))
        return (self._parameters.noise * random.standard_normal((_BLOCK, 6))).ravel()

    def _filter_state(self, context: Context, load: np.ndarray) -> np.ndarray:
        state = context.get_discrete_state(self._filter).value()
        # NaN where it has not started; a sum is NaN if one of its terms is
        if not math.isnan(state.sum()):
            return state
        return np.where(np.isnan(state), self._low_pass.rest(load), state)

    def _calc_load(self, context: Context, output: BasicVector) -> None:
        reaction = self._reactions.Eval(context)[self._joint]
        load = np.empty(6)
        load[:3], load[3:] = reaction.translational(), reaction.rotational()
        output.SetFromVector(-load)

    def _calc_measured_wrench(self, context: Context, output: BasicVector) -> None:
        load, limit = self._load.Eval(context), self._parameters.measurement_range
        row = 6 * (int(context.get_discrete_state(self._tick)[0]) % _BLOCK)
        noise = context.get_discrete_state(self._noise).value()[row : row + 6]
        filtered = self._low_pass.output(self._filter_state(context, load), load)
        reading = filtered + self._parameters.bias + noise
        output.SetFromVector(np.minimum(np.maximum(reading, -limit), limit))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        load = self._load.Eval(context)
        tick = int(context.get_discrete_state(self._tick)[0]) + 1
        filtered = self._low_pass.update(self._filter_state(context, load), load)
        state.get_mutable_value(self._filter)[:] = filtered
        state.get_mutable_value(self._tick)[0] = tick
        if tick % _BLOCK == 0:
            state.get_mutable_value(self._noise)[:] = self._draw(tick // _BLOCK)


def _check(key: str, value: np.ndarray, *, positive: bool) -> None:
    value = np.asarray(value, dtype=float)
    fits = value.shape == (6,) and np.all(np.isfinite(value))
    if not (fits and np.all(value > 0.0 if positive else value >= 0.0)):
        allowed = "positive" if positive else "finite, not negative"
        raise InputError(f"{key} = {value.tolist()}: must be 6 {allowed} numbers")
