"""Friction compensation: friction model, observer, and torque at rest."""

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
from pfsc_drake.controller.nominal_robot import Coefficients, NominalRobot
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.friction_parameters import FrictionCompensationParameters
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

# rad or m, and s; see RestHold
_DRIFT, _SHAKING, _WINDOW, _SETTLING = 1e-3, 0.02, 2e-4, 0.03
# m or rad; largest error at which a law with an integral part relies on friction
_LARGEST_ERROR = 2e-3
# m or rad; largest motion of a workpiece relative to the tool while the torques are constant
_LARGEST_CHANGE = 3e-4
# relative change of a coefficient from sample to sample
_COEFFICIENT_DRIFT = 1e-3


def rest_hold(
    law: FollowingLaw, nominal: NominalRobot, options: ControllerParameters
) -> RestHold | None:
    """Return the constant torque of sticking drives, if friction is known and compensated.

    With a manifold point that moves with time rest is not detected: the law stays active.

    Args:
        law: The law.
        nominal: Nominal model of the robot.
        options: Parameters of the controller.
    """
    friction, linearization = options.friction, law.linearization
    if friction.source == "none" or not friction.hold_at_rest or nominal.friction is None:
        return None
    if linearization.relative_degree == 1 or linearization.manifold.follows_time:
        return None
    largest = _LARGEST_ERROR if law.stabilization.has_integral_part else np.inf
    return RestHold(
        np.asarray(nominal.friction[0], dtype=float),
        _DRIFT,
        _SHAKING,
        _WINDOW,
        max(2, round(_SETTLING / options.sampling_time)),
        largest,
        _LARGEST_CHANGE if isinstance(linearization.manifold, MovingFrameManifold) else np.inf,
    )


def add_friction_compensation(
    builder: DiagramBuilder,
    nominal: NominalRobot,
    options: ControllerParameters,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> tuple[OutputPort | None, dict[str, OutputPort]]:
    """Add the compensation of friction, if it is chosen.

    Args:
        builder: Builder of the diagram.
        nominal: Nominal model of the robot.
        options: Parameters of the controller.
        controller: The controller.
        ports: ``joint_state`` as measured, and ``tau_ext`` if the law uses it.

    Returns:
        The compensated friction torque, shape (N,), if there is one; and for the log
        ``friction_estimate``, torques of shape (N,), or from the Kalman filter of shape (3N,),
        ``[tau_f, f_c, f_v]``, if there is any.

    Raises:
        InputError: If the compensation does not suit the robot, or lacks coefficients.
    """
    parameters = options.friction
    # servos overcome friction themselves, and do not report their torques; law_warnings warns
    if not parameters.is_given or controller.relative_degree == 1:
        return None, {}
    signals = ports | {"drive_torque": controller.GetOutputPort("drive_torque")}
    if parameters.needs_reference_velocity:
        signals["velocity"] = controller.GetOutputPort("reference_velocity")
    logged, compensated = {}, None
    if parameters.source == "model":
        compensated = _add_model(
            builder, parameters, nominal.friction, signals, options.sampling_time
        )
        logged = {"friction_estimate": compensated}
    if parameters.source == "observer" or parameters.watched:
        torque, estimate = _add_observer(builder, nominal, options, signals)
        logged = {"friction_estimate": estimate}
        if parameters.source == "observer":
            compensated = torque
    if compensated is not None:
        builder.Connect(compensated, controller.GetInputPort("friction_torque"))
    return compensated, logged


def _add_model(
    builder: DiagramBuilder,
    parameters: FrictionCompensationParameters,
    coefficients: Coefficients | None,
    ports: dict[str, OutputPort],
    period: float,
) -> OutputPort:
    """Add friction with nominal coefficients, and return its torque."""
    f_c, f_v = _require_coefficients(coefficients, "source = model")
    velocity = ports.get("velocity", ports["joint_state"])
    friction = FrictionModel(f_c, f_v, parameters.smoothing, velocity.size())
    model = builder.AddNamedSystem("friction_compensation", BlockSystem(friction, period))
    builder.Connect(velocity, model.GetInputPort("velocity"))
    return model.GetOutputPort("friction_torque")


def _add_observer(
    builder: DiagramBuilder,
    nominal: NominalRobot,
    options: ControllerParameters,
    ports: dict[str, OutputPort],
) -> tuple[OutputPort, OutputPort]:
    """Add an observer of friction, and return its torque and its whole estimate."""
    parameters, period = options.friction, options.sampling_time
    momentum = drive_momentum(nominal.robot).with_delay(nominal.velocity_delay)
    block: FrictionKalmanFilter | MomentumObserver
    if parameters.observer == "kalman":
        coefficients = _require_coefficients(nominal.friction, "observer = kalman")
        block, torque = _kalman(parameters, momentum, coefficients, period), "friction_torque"
    else:
        block, torque = MomentumObserver(momentum, parameters.rate, period), "estimate"
    observer = builder.AddNamedSystem("friction_observer", BlockSystem(block, period))
    for name in ("joint_state", "drive_torque", "velocity"):
        if name in ports and observer.HasInputPort(name):
            builder.Connect(ports[name], observer.GetInputPort(name))
    if "tau_ext" in ports and momentum.known_weight.any():
        # laws for rigid joints get torques without derivatives
        builder.Connect(ports["tau_ext"], observer.GetInputPort("known_torque"))
    return observer.GetOutputPort(torque), observer.GetOutputPort("estimate")


def _require_coefficients(coefficients: Coefficients | None, choice: str) -> Coefficients:
    """Return coefficients, or raise an error with the place to write them."""
    if coefficients is None:
        raise InputError(
            f"controller.friction.{choice}: no nominal friction; write "
            "controller.friction.nominal: {f_c: [..], f_v: [..]} or {file: ..}, in a diagram "
            "FollowerOptions(friction=(f_c, f_v))"
        )
    return coefficients


def _kalman(
    parameters: FrictionCompensationParameters,
    momentum: MomentumModel,
    coefficients: Coefficients,
    period: float,
) -> FrictionKalmanFilter:
    kalman, n = parameters.kalman, momentum.dimension

    def values(key: str, nominal: np.ndarray | None = None) -> np.ndarray:
        noise = getattr(kalman, key)
        if nominal is not None and not noise:
            return (_COEFFICIENT_DRIFT * nominal) ** 2
        if len(noise) not in (1, n):
            raise InputError(
                f"controller.friction.kalman.{key}: {len(noise)} values; allowed: 1 or {n}, the "
                "robot's joints"
            )
        return np.broadcast_to(np.array(noise, dtype=float), n)

    return FrictionKalmanFilter(
        momentum,
        kalman.start * np.array(coefficients),
        FrictionNoise(
            values("momentum_noise"),
            values("coulomb_noise", coefficients[0]),
            values("viscous_noise", coefficients[1]),
            values("measurement_noise"),
            kalman.initial_variance,
        ),
        period,
        intervals=kalman.intervals,
        resting_velocity=kalman.resting_velocity,
        smoothing=parameters.smoothing,
    )
