"""Whether what was estimated can be: friction brakes, rotors have inertia, models explain."""

import numpy as np

from identification.estimation.least_squares import Estimate
from identification.model.base import BaseParameters
from pfsc_drake.errors import InputError

_NEVER_NEGATIVE = ("f_c", "f_v", "I_M")
# standard deviations below zero from which on a parameter cannot be; the torque that it makes has
# to be this part of the noise of a measurement, too
SURE, MATERIAL = 5.0, 0.2
# RMS of residuals in units of the noise of a measurement, and of the torques about their mean,
# above both of which a model does not explain them
_MOST_NOISE, _MOST_TORQUE = 4.0, 0.3
_SPEEDS = 50  # at which friction of several terms is looked at


def refuse_implausible(estimate: Estimate) -> None:
    """Refuse an estimate that no robot has, or that does not explain the torques.

    Args:
        estimate: The estimate.

    Raises:
        InputError: If friction or a rotor's inertia is below zero for sure, or residuals are
            several times the noise of repetitions and not small beside the torques.
    """
    robot, rank = estimate.robot_base, estimate.robot_base.rank
    spread = np.sqrt(max(estimate.variance_factor, 1.0))
    noise = np.sqrt(estimate.motion.torque_variance)
    columns = estimate.system.matrix[..., :rank] / noise[:, None]
    found = never_negative(
        robot,
        estimate.base_parameters[:rank],
        estimate.standard_deviation[:rank] * spread,
        np.sqrt(np.mean(np.sum(columns**2, axis=1), axis=0)),
        [f"joint_{term.joint + 1}" for term in estimate.friction.terms],
    ) or _driving_friction(estimate, spread)
    if found is not None:
        raise InputError(
            f"{estimate.robot}: {describe_negative(*found)}: sign of tau or q, the model's axes, "
            "or friction of another form (a record for --validation tells it)"
        )
    _refuse_unexplained(estimate, noise)


def never_negative(
    base: BaseParameters,
    parameters: np.ndarray,
    deviation: np.ndarray,
    sizes: np.ndarray,
    but: list[str] | None = None,
) -> tuple[str, str, float, float] | None:
    """Return what cannot be below zero and is, the surest: name, unit, value, deviation.

    Friction and rotor inertia count where torques tell them from all else.

    Args:
        base: What the parameters are combinations of.
        parameters: Shape (n_b,).
        deviation: Standard deviations of them, shape (n_b,).
        sizes: RMS of the torque that a parameter of one makes, in units of the noise of one
            measurement, shape (n_b,).
        but: Joints whose friction has further terms and is no matter of one parameter.
    """
    below = [
        i
        for i, (name, row) in enumerate(zip(base.short_names, base.projection, strict=True))
        if name.split(".")[1] in _NEVER_NEGATIVE
        and not (name.split(".")[0] in (but or []) and ".f_" in name)
        and np.count_nonzero(row) == 1
        and parameters[i] < -SURE * deviation[i]
        and -parameters[i] * sizes[i] > MATERIAL
    ]
    if not below:
        return None
    i = min(below, key=lambda i: float(parameters[i] / deviation[i]))
    return base.short_names[i], base.units[i], float(parameters[i]), float(deviation[i])


def describe_negative(name: str, unit: str, value: float, deviation: float) -> str:
    """Return that something is below zero that cannot be, in words.

    Args:
        name: Name of the parameter.
        unit: Unit of the parameter.
        value: Value of the parameter.
        deviation: Standard deviation of that.
    """
    return (
        f"{name} = {value:.3g} {unit}, {-value / deviation:.0f} standard deviations below zero, "
        "and cannot be negative"
    )


def _driving_friction(estimate: Estimate, spread: float) -> tuple[str, str, float, float] | None:
    """Return where friction of several terms drives a joint for sure."""
    base, still = estimate.base, estimate.system.still
    for j in sorted({term.joint for term in estimate.friction.terms}):
        own = [i for i, name in enumerate(base.short_names) if name.startswith(f"joint_{j + 1}.f_")]
        fastest = float(np.abs(estimate.motion.v[:, j]).max())
        if still[j] or not fastest > 0.0:
            continue
        sign = np.repeat([1.0, -1.0], _SPEEDS)
        v = sign * np.tile(np.linspace(0.1, 1.0, _SPEEDS) * fastest, 2)
        columns = {f"joint_{j + 1}.f_c": sign, f"joint_{j + 1}.f_v": v}
        columns |= {t.name: t.column(v) for t in estimate.friction.terms if t.joint == j}
        A = sign[:, None] * np.column_stack([columns[base.short_names[i]] for i in own])
        braking = A @ estimate.base_parameters[own]
        covariance = estimate.covariance[np.ix_(own, own)]
        deviation = spread * np.sqrt(np.einsum("kp,pq,kq->k", A, covariance, A))
        noise = float(np.sqrt(estimate.motion.torque_variance[j]))
        drives = (braking < -SURE * deviation) & (-braking > MATERIAL * noise)
        if drives.any():
            k = int(np.argmax(drives))
            unit = "Nm" if estimate.joint_units[j] == "rad" else "N"
            what = f"friction of {estimate.joint_names[j]} against {v[k]:.3g} "
            what += f"{estimate.joint_units[j]}/s"
            return what, unit, float(braking[k]), float(deviation[k])
    return None


def _refuse_unexplained(estimate: Estimate, noise: np.ndarray) -> None:
    used = estimate.system.used
    count = np.maximum(used.sum(axis=0), 1)
    rms = np.sqrt(np.sum(np.where(used, estimate.residuals, 0.0) ** 2, axis=0) / count)
    torque = np.std(estimate.system.torques, axis=0)
    excess = np.minimum(rms / (_MOST_NOISE * noise), rms / (_MOST_TORQUE * torque))
    j = int(np.argmax(np.where(np.isfinite(excess), excess, 0.0)))
    if excess[j] > 1.0:
        raise InputError(
            f"{estimate.robot}: what the model leaves of tau of {estimate.joint_names[j]} is "
            f"{rms[j] / noise[j]:.3g} times the noise of repetitions ({_MOST_NOISE:g} is allowed) "
            f"and {100.0 * rms[j] / torque[j]:.2g} % of the torque ({100.0 * _MOST_TORQUE:g} % is "
            "allowed), which no sign, order or unit of a signal explains: axes, zeros or gravity "
            "of the model, something else that acts on the robot, or friction of another form (a "
            "record for --validation tells it)"
        )
