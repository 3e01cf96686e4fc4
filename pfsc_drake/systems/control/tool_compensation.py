"""Taking weight and inertia of the tool off a force/torque measurement, and taring it."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, JointIndex, RigidBody, SpatialInertia, WeldJoint
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.compliance.force_sensing import guarded_compensation
from pfsc_drake.control.compliance.still_components import STILL_TIME, memory_size
from pfsc_drake.control.compliance.tool_load import (
    TARING_BLOCK,
    SensorFault,
    Taring,
    ToolCompensationParameters,
    ToolLoad,
    compensation_function,
)
from pfsc_drake.control.estimation.low_pass import LowPass
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.can_fail import is_tick

# parts of the output
_WRENCH, _TARED, _FAULT, _RESIDUAL, _NEXT = slice(0, 6), 6, 7, slice(8, 14), slice(14, None)
# parts of the state; tared and fault stand where they stand in the output
_BIAS, _KNOWN, _WINDOW = slice(0, 6), 8, slice(9, 9 + Taring.size)
_FILTER = slice(_WINDOW.stop, None)
_MEMORY = {
    "bias": _BIAS,
    "tared": slice(_TARED, _TARED + 1),
    "fault": slice(_FAULT, _FAULT + 1),
    "known": slice(_KNOWN, _KNOWN + 1),
    "state": _FILTER,
}

# attributes of an enumeration are looked up slowly
_LOST = float(SensorFault.LOST)


class ToolCompensation(LeafSystem):
    """Estimates what the environment applies to the tool.

    With the load r = measured - predicted that the tool alone does not explain (see
    :func:`compensation_function`), the output is ``r - b`` as a wrench at the tool point
    in world axes: what is applied **to** the robot. The bias b is the mean of r over the
    first quiet stretch (see :class:`Taring`). Until there is one the output is exactly
    zero, so that an untared sensor moves nothing; a sensor that saturates or moves is
    not tared, and taring goes on. A constant force that acts while taring is taken for
    bias, as with any such sensor.

    The joints' motion goes through the same filter as the sensor's signal, so that load
    and measurement are of the same age.

    A measurement or joint state that is not finite, or a component of the measurement that
    stands still while others move, makes the output zero, and a fault
    that only :meth:`tare` or a new initialization clears. A saturated sensor is reported
    while it lasts; its output is the clipped one.

    Ports:
        measured_wrench (input): ``[force, torque]`` in the sensor frame, shape (6,) [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        joint_acceleration (input): ``q_J''``, shape (N,); only with inertia ``given``. It
            must not depend on this system's output in the same tick.
        wrench (output): ``[force, torque]`` at the tool point, world axes, shape (6,) [N, Nm].
        tared (output): 1 once the bias is known, else 0.
        fault (output): A :class:`SensorFault`.
        compensation (output): ``[wrench, tared, fault, r]`` and the filter's next state,
            shape (14 + size of that state,); computed once per tick, the others are parts
            of it.

    State:
        Discrete: bias, shape (6,); tared, fault, whether the filter's state is known, shape
        (1,) each; taring window, shape (25,); state of the filter of the joints' motion,
        see :func:`compensation_function`, shape (2N,) or (3N,); what is remembered of the
        measurement, shape (18,).

    Args:
        robot: The robot with the tool.
        load: Everything behind the sensor, see :func:`tool_load_from_plant`.
        measurement_range: Of the sensor, shape (6,) [N, Nm].
        parameters: How to compensate.
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth does not suit the period.
    """

    def __init__(
        self,
        robot: RobotModel,
        load: ToolLoad,
        measurement_range: np.ndarray,
        parameters: ToolCompensationParameters,
        period: float,
    ) -> None:
        super().__init__()
        n, self._period = robot.dimension, period
        samples = max(1, round(parameters.taring_time / period))
        block = max(1, round(TARING_BLOCK / period))
        self._taring = Taring(samples, parameters.taring_spread, parameters.taring_bias, block)
        function = compensation_function(
            robot,
            load,
            LowPass(parameters.bandwidth, period),
            parameters.inertia,
            (parameters.force_dead_band, parameters.torque_dead_band),
        )
        self._num_samples, size = function.numel_in("motion"), function.numel_in("state")
        size += memory_size(6)
        blank = np.zeros(_FILTER.start + size)
        blank[_WINDOW] = self._taring.empty()
        self.DeclareDiscreteState(blank)
        # the function reads the state where one copy puts it
        self._memory = blank.copy()
        step = BoundFunction(
            guarded_compensation(
                function,
                np.asarray(measurement_range),
                max(10, round(STILL_TIME / period)),
                parameters.noise,
            ),
            **{name: self._memory[part] for name, part in _MEMORY.items()},
        )
        self._evaluate, self._result = step.evaluate, step.results["result"]
        self._motion, self._reading = step.arguments["motion"], step.arguments["measured"]
        self._measured = self.DeclareVectorInputPort("measured_wrench", 6)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        sources = {self._measured.ticket(), self._joint_state.ticket(), self.xd_ticket()}
        self._acceleration = None
        if parameters.inertia == "given":
            self._acceleration = self.DeclareVectorInputPort("joint_acceleration", n)
            sources.add(self._acceleration.ticket())
        self._output = self.DeclareVectorOutputPort(
            "compensation", 14 + size, self._calc_compensation, prerequisites_of_calc=sources
        )
        for name, part in (
            ("wrench", _WRENCH),
            ("tared", slice(_TARED, _TARED + 1)),
            ("fault", slice(_FAULT, _FAULT + 1)),
        ):

            def calc(context: Context, output: BasicVector, part: slice = part) -> None:
                output.SetFromVector(self._output.Eval(context)[part])

            width = part.stop - part.start
            self.DeclareVectorOutputPort(name, width, calc, prerequisites_of_calc=sources)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def fault(self, context: Context) -> Fault:
        """See :class:`FailingSystem`.

        A sensor at the end of its range is none until it is tared, since nobody uses it.
        """
        if is_tick(context, self._period):
            tared, fault = self._output.Eval(context)[_TARED : _FAULT + 1]
        else:
            tared, fault = context.get_discrete_state_vector().value()[[_TARED, _FAULT]]
        if fault == SensorFault.SATURATED:
            return Fault.FORCE_SENSOR_SATURATED if tared else Fault.NONE
        return Fault.FORCE_SENSOR_LOST if fault else Fault.NONE

    def tare(self, context: Context) -> None:
        """Forget bias and fault and tare anew; the output is zero until that is done."""
        memory = context.get_mutable_discrete_state_vector().get_mutable_value()
        memory[_TARED], memory[_FAULT], memory[_KNOWN] = 0.0, SensorFault.NONE, 0.0
        memory[_WINDOW] = self._taring.empty()
        memory[-memory_size(6) :] = 0.0

    def external_load(self, context: Context) -> np.ndarray | None:
        """Return what acts beside the tool, in the sensor frame, shape (6,) [N, Nm].

        None as long as the sensor is not tared.

        Args:
            context: The system's own.
        """
        result = self._output.Eval(context)
        return result[_RESIDUAL] - self.bias(context) if result[_TARED] else None

    def tare_at(self, context: Context, reading: Context, load: np.ndarray) -> None:
        """Tare at once, knowing what acts beside the tool; a run waits for a quiet stretch.

        Args:
            context: The system's own, which is tared.
            reading: The same system's at the tick that tells the residual.
            load: What acts, in the sensor frame, shape (6,) [N, Nm].
        """
        residual = self._output.Eval(reading)[_RESIDUAL]
        memory = context.get_mutable_discrete_state_vector().get_mutable_value()
        memory[_BIAS], memory[_TARED] = residual - load, 1.0
        memory[_WINDOW] = self._taring.empty()

    def bias(self, context: Context) -> np.ndarray:
        """Return the bias in use, in the sensor frame, shape (6,) [N, Nm]."""
        return context.get_discrete_state_vector().value()[_BIAS].copy()

    def _calc_compensation(self, context: Context, output: BasicVector) -> None:
        joint_state = self._joint_state.Eval(context)
        if self._acceleration is None:
            self._motion[:] = joint_state[: self._num_samples]
        else:
            acceleration = self._acceleration.Eval(context)
            self._motion[: -len(acceleration)] = joint_state[: 2 * len(acceleration)]
            self._motion[-len(acceleration) :] = acceleration
        self._reading[:] = self._measured.Eval(context)
        self._memory[:] = context.get_discrete_state_vector().value()
        self._evaluate()
        output.SetFromVector(self._result)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        result = self._output.Eval(context)
        memory = state.get_mutable_value()
        if result[_FAULT] == _LOST:
            memory[_FAULT] = _LOST
            return
        memory[_FILTER] = result[_NEXT]
        memory[_KNOWN] = 1.0
        if not result[_TARED]:
            self._tare_further(memory, result)

    def _tare_further(self, memory: np.ndarray, result: np.ndarray) -> None:
        window = self._taring.empty()
        if not result[_FAULT]:
            window = self._taring.extend(memory[_WINDOW], result[_RESIDUAL])
        bias = self._taring.bias(window)
        if bias is not None:
            window = self._taring.empty()
            if np.isfinite(bias).all():
                memory[_BIAS], memory[_TARED] = bias, 1.0
        memory[_WINDOW] = window


def tool_load_from_plant(plant: MultibodyPlant, joint: Joint, tool_frame: Frame) -> ToolLoad:
    """Return everything that a plant has fixed behind a sensor.

    Args:
        plant: A finalized plant.
        joint: The fixed joint with the sensor in it; its child side is the tool.
        tool_frame: Frame at the tool point.

    Raises:
        InputError: If the joint is not fixed, something moves behind it, or the tool point is
            not behind it.
    """
    bodies = _bodies_behind(plant, joint)
    if tool_frame.body().index() not in [body.index() for body in bodies]:
        raise InputError(
            f"tool frame '{tool_frame.name()}': is not behind the joint '{joint.name()}' of the "
            "force/torque sensor; it must be fixed to that joint's child"
        )
    context = plant.CreateDefaultContext()
    frame_S = joint.frame_on_child()
    M = SpatialInertia.Zero()
    for body in bodies:
        X_SB = plant.CalcRelativeTransform(context, frame_S, body.body_frame())
        M_B = body.CalcSpatialInertiaInBodyFrame(context)
        M += M_B.ReExpress(X_SB.rotation()).Shift(-X_SB.translation())
    p_SC = M.get_com()
    I_C = M.Shift(p_SC).CalcRotationalInertia().CopyToFullMatrix3()
    X_ST = plant.CalcRelativeTransform(context, frame_S, tool_frame)
    gravity = plant.gravity_field().gravity_vector()
    R_ST, p_ST = X_ST.rotation().matrix(), X_ST.translation()
    return ToolLoad(M.get_mass(), p_SC, I_C, R_ST, p_ST, gravity)


def _bodies_behind(plant: MultibodyPlant, sensor: Joint) -> list[RigidBody]:
    """Return the bodies on the child side of a fixed joint."""
    if not isinstance(sensor, WeldJoint):
        raise InputError(
            f"joint '{sensor.name()}' of the force/torque sensor: type '{sensor.type_name()}'; "
            "must be a fixed joint"
        )
    bodies = [sensor.child_body()]
    joints = [plant.get_joint(JointIndex(i)) for i in plant.GetJointIndices()]
    joints = [joint for joint in joints if joint.index() != sensor.index()]
    for body in bodies:
        for joint in joints:
            ends = [joint.parent_body(), joint.child_body()]
            if body.index() not in [end.index() for end in ends]:
                continue
            if not isinstance(joint, WeldJoint):
                raise InputError(
                    f"joint '{joint.name()}': moves behind the force/torque sensor in "
                    f"'{sensor.name()}'; only fixed joints are allowed there"
                )
            known = [b.index() for b in bodies]
            bodies += [end for end in ends if end.index() not in known]
    return bodies
