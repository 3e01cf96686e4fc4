"""A six-axis force/torque sensor in a fixed joint between flange and tool."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, WeldJoint
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.estimation.low_pass import LowPass
from pfsc_drake.errors import InputError
from pfsc_drake.physics.transducer import transducer_function

# ticks whose noise is drawn at once
_BLOCK = 64
# parts of the state
_FILTER, _TICK, _NOISE = slice(0, 6), 6, 7
# parts of the measurement
_READING, _LOAD, _NEXT = slice(0, 6), slice(6, 12), slice(12, 18)


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
        reaction_forces (input): The plant's reaction forces, abstract; or, of plants that do
            not tell them, ``reaction``, F as ``[torque, force]`` in S, shape (6,), see
            :class:`ToolReaction`.
        measured_wrench (output): ``[force, torque]`` in S, shape (6,) [N, Nm].
        load (output): ``-F``, what an ideal sensor would read, shape (6,) [N, Nm].
        measurement (output): ``[measured_wrench, load]`` and the filter's next state, shape
            (18,); computed once per tick, the others are parts of it.

    State:
        Discrete: state of the filter, shape (6,), NaN before the first tick; number of the
        tick, shape (1,); noise of a block of ticks, shape (64, 6) by rows. The noise of
        tick k depends on seed and k alone.

    Args:
        parameters: The sensor's properties.
        period: Sampling time [s].
        index: Of the sensor's joint in the plant's reactions, see :func:`reaction_index`;
            without it F comes from the port ``reaction``.

    Raises:
        InputError: If the bandwidth is too large for the period.
    """

    def __init__(
        self, parameters: ForceTorqueParameters, period: float, index: int | None = None
    ) -> None:
        super().__init__()
        self._joint = index
        self._parameters = parameters
        self._result = np.zeros(18)
        low_pass = LowPass(parameters.bandwidth, period)
        transducer = BoundFunction(
            transducer_function(low_pass, parameters.bias, parameters.measurement_range),
            reading=self._result[_READING],
            load=self._result[_LOAD],
            next_state=self._result[_NEXT],
        )
        self._evaluate = transducer.evaluate
        self._reaction, self._state, self._sample = transducer.arguments.values()
        memory = np.concatenate([np.full(6, np.nan), [0.0], self._draw(0)])
        state = self.discrete_state_ticket(self.DeclareDiscreteState(memory))
        self._reactions = (
            self.DeclareVectorInputPort("reaction", 6)
            if index is None
            else self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        )
        reactions = self._reactions.ticket()
        self._measurement = self.DeclareVectorOutputPort(
            "measurement", 18, self._calc_measurement, prerequisites_of_calc={reactions, state}
        )
        self.DeclareVectorOutputPort(
            "measured_wrench",
            6,
            self._calc_measured_wrench,
            prerequisites_of_calc={reactions, state},
        )
        self.DeclareVectorOutputPort("load", 6, self._calc_load, prerequisites_of_calc={reactions})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _draw(self, block: int) -> np.ndarray:
        random = np.random.default_rng((self._parameters.seed, block))
        return (self._parameters.noise * random.standard_normal((_BLOCK, 6))).ravel()

    def _read_reaction(self, context: Context) -> np.ndarray:
        """Return ``[torque, force]`` on the tool."""
        reaction = self._reactions.Eval(context)
        return reaction if self._joint is None else reaction[self._joint].get_coeffs()

    def _calc_measurement(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        row = _NOISE + 6 * (int(memory[_TICK]) % _BLOCK)
        self._sample[:] = memory[row : row + 6]
        self._state[:] = memory[_FILTER]
        self._reaction[:] = self._read_reaction(context)
        self._evaluate()
        output.SetFromVector(self._result)

    def _calc_measured_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._measurement.Eval(context)[_READING])

    def _calc_load(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(-np.roll(self._read_reaction(context), 3))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        memory = state.get_mutable_value()
        tick = int(memory[_TICK]) + 1
        memory[_FILTER] = self._measurement.Eval(context)[_NEXT]
        memory[_TICK] = tick
        if tick % _BLOCK == 0:
            memory[_NOISE:] = self._draw(tick // _BLOCK)


def reaction_index(plant: MultibodyPlant, joint: Joint) -> int:
    """Return where a joint stands in a plant's reaction forces.

    Args:
        plant: A finalized plant.
        joint: The joint with the sensor in it.

    Raises:
        InputError: If the joint is not fixed.
    """
    if not isinstance(joint, WeldJoint):
        raise InputError(
            f"joint '{joint.name()}' of the force/torque sensor: type '{joint.type_name()}'; "
            "must be a fixed joint"
        )
    # reactions are numbered without gaps, also where joints were removed
    return list(plant.GetJointIndices()).index(joint.index())


def _check(key: str, value: np.ndarray, *, positive: bool) -> None:
    value = np.asarray(value, dtype=float)
    fits = value.shape == (6,) and np.all(np.isfinite(value))
    if not (fits and np.all(value > 0.0 if positive else value >= 0.0)):
        allowed = "positive" if positive else "finite, not negative"
        raise InputError(f"{key} = {value.tolist()}: must be 6 {allowed} numbers")
