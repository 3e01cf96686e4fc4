"""What the law is told about friction."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.estimation.friction_filter import (
    FrictionKalmanFilter,
    FrictionModel,
    FrictionNoise,
)
from pfsc_drake.control.estimation.momentum import (
    MomentumModel,
    MomentumObserver,
    drive_momentum,
)
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.rest_hold import RestHold
from pfsc_drake.control.manifolds.moving_frame import MovingFrameManifold
from pfsc_drake.controller.believed import Believed, Coefficients
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.friction_parameters import FrictionCompensationParameters
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

# rad or m, and s; see RestHold
_DRIFT, _SHAKING, _WINDOW, _SETTLING = 1e-3, 0.02, 2e-4, 0.03
# m or rad; up to which error a law with an integral part leaves the rest to friction
_LARGEST_ERROR = 2e-3
# m or rad; by which a workpiece may get away from the tool before the law goes on
_LARGEST_CHANGE = 3e-4
# by which part of itself a coefficient is thought to change from sample to sample
_COEFFICIENT_DRIFT = 1e-3


def rest_hold(
    law: FollowingLaw, believed: Believed, options: ControllerParameters
) -> RestHold | None:
    """Return what holds the torques of drives that stick, if friction is known and compensated.

    Where a manifold's point moves with time, nothing tells whether it rests: there the law goes on.

    Args:
        law: The law.
        believed: The robot.
        options: What is chosen of the controller.
    """
    friction, linearization = options.friction, law.linearization
    if friction.source == "none" or not friction.hold_at_rest or believed.friction is None:
        return None
    if linearization.relative_degree == 1 or linearization.manifold.follows_time:
        return None
    largest = _LARGEST_ERROR if law.stabilization.has_integral_part else np.inf
    return RestHold(
        np.asarray(believed.friction[0], dtype=float),
        _DRIFT,
        _SHAKING,
        _WINDOW,
        max(2, round(_SETTLING / options.sampling_time)),
        largest,
        _LARGEST_CHANGE if isinstance(linearization.manifold, MovingFrameManifold) else np.inf,
    )


def add_friction_compensation(
    builder: DiagramBuilder,
    believed: Believed,
    options: ControllerParameters,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> tuple[OutputPort | None, dict[str, OutputPort]]:
    """Let the law overcome friction, if it is to.

    Args:
        builder: Builder of the diagram.
        believed: The robot.
        options: What is chosen of the controller.
        controller: The controller.
        ports: ``joint_state`` as measured, and ``tau_ext`` if the law is told of it.

    Returns:
        The friction torque that is compensated, if any is, shape (N,); and for the log
        ``friction_estimate``, torques of shape (N,), or from the Kalman filter of shape (3N,),
        ``[tau_f, f_c, f_v]``, if there is any.

    Raises:
        InputError: If the compensation does not suit the robot, or lacks coefficients.
    """
    parameters = options.friction
    # servos overcome friction themselves, and do not tell their torques; law_warnings says so
    if not parameters.is_given or controller.relative_degree == 1:
        return None, {}
    signals = ports | {"drive_torque": controller.GetOutputPort("drive_torque")}
    if parameters.needs_reference_velocity:
        signals["velocity"] = controller.GetOutputPort("reference_velocity")
    logged, compensated = {}, None
    if parameters.source == "model":
        compensated = _add_model(
            builder, parameters, believed.friction, signals, options.sampling_time
        )
        logged = {"friction_estimate": compensated}
    if parameters.source == "observer" or parameters.watched:
        torque, estimate = _add_observer(builder, believed, options, signals)
        logged = {"friction_estimate": estimate}
        if parameters.source == "observer":
            compensated = torque
    if compensated is not None:
        builder.Connect(compensated, controller.GetInputPort("friction_torque"))
    return compensated, logged


def _add_model(
    builder: DiagramBuilder,
    parameters: FrictionCompensationParameters,
    believed: Coefficients | None,
    ports: dict[str, OutputPort],
    period: float,
) -> OutputPort:
    """Add friction of believed coefficients, and return its torque."""
    f_c, f_v = _required(believed, "source = model")
    velocity = ports.get("velocity", ports["joint_state"])
    friction = FrictionModel(f_c, f_v, parameters.smoothing, velocity.size())
    model = builder.AddNamedSystem("friction_compensation", BlockSystem(friction, period))
    builder.Connect(velocity, model.GetInputPort("velocity"))
    return model.GetOutputPort("friction_torque")


def _add_observer(
    builder: DiagramBuilder,
    believed: Believed,
    options: ControllerParameters,
    ports: dict[str, OutputPort],
) -> tuple[OutputPort, OutputPort]:
    """Add an observer of friction, and return the torque and all that it tells."""
    parameters, period = options.friction, options.sampling_time
    momentum = drive_momentum(believed.robot).with_delay(believed.velocity_delay)
    block: FrictionKalmanFilter | MomentumObserver
    if parameters.observer == "kalman":
        coefficients = _required(believed.friction, "observer = kalman")
        block, torque = _kalman(parameters, momentum, coefficients, period), "friction_torque"
    else:
        block, torque = MomentumObserver(momentum, parameters.rate, period), "estimate"
    observer = builder.AddNamedSystem("friction_observer", BlockSystem(block, period))
    for name in ("joint_state", "drive_torque", "velocity"):
        if name in ports and observer.HasInputPort(name):
            builder.Connect(ports[name], observer.GetInputPort(name))
    if "tau_ext" in ports and momentum.known_weight.any():
        # laws for rigid joints are told torques without derivatives
        builder.Connect(ports["tau_ext"], observer.GetInputPort("known_torque"))
    return observer.GetOutputPort(torque), observer.GetOutputPort("estimate")


def _required(believed: Coefficients | None, choice: str) -> Coefficients:
    """Return coefficients, or say where they can be written."""
    if believed is None:
        raise InputError(
            f"controller.friction.{choice}: nothing is believed of friction; write "
            "controller.friction.believed: {f_c: [..], f_v: [..]} or {file: ..}, in a diagram "
            "FollowerOptions(friction=(f_c, f_v))"
        )
    return believed


def _kalman(
    parameters: FrictionCompensationParameters,
    momentum: MomentumModel,
    believed: Coefficients,
    period: float,
) -> FrictionKalmanFilter:
    kalman, n = parameters.kalman, momentum.dimension

    def values(key: str, believed: np.ndarray | None = None) -> np.ndarray:
        given = getattr(kalman, key)
        if believed is not None and not given:
            return (_COEFFICIENT_DRIFT * believed) ** 2
        if len(given) not in (1, n):
            raise InputError(
                f"controller.friction.kalman.{key}: {len(given)} values; allowed: 1 or {n}, the "
                "robot's joints"
            )
        return np.broadcast_to(np.array(given, dtype=float), n)

    return FrictionKalmanFilter(
        momentum,
        kalman.start * np.array(believed),
        FrictionNoise(
            values("momentum_noise"),
            values("coulomb_noise", believed[0]),
            values("viscous_noise", believed[1]),
            values("measurement_noise"),
            kalman.initial_variance,
        ),
        period,
        intervals=kalman.intervals,
        resting_velocity=kalman.resting_velocity,
        smoothing=parameters.smoothing,
    )
