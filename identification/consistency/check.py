"""Whether parameters are those of a robot, and what is wrong if not."""

from dataclasses import dataclass

import numpy as np

from identification.consistency.layout import Layout
from identification.consistency.pseudo_inertia import pseudo_inertia
from identification.model.base import random_motion
from identification.model.parameters import link_moments, parameter_names
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

# of the largest moment of inertia, by which rounding may break an inequality
_ROUNDING = 1e-9
_SEEDS, _ROUNDS, _NEIGHBOURS, _SHRINK = 8, 8, 200, 0.6


@dataclass(frozen=True, eq=False)
class LeastEigenvalue:
    """Where the mass matrix of the links is nearest to being singular.

    Attributes:
        value: Least eigenvalue of ``D_E`` [kg m^2, kg for slides]; positive if it is definite.
        q: Posture [rad or m], shape (N,).
    """

    value: float
    q: np.ndarray


def inconsistencies(subject: Subject, parameters: np.ndarray) -> list[str]:
    """Return what no body has, one sentence each; nothing for a consistent set.

    Args:
        subject: The robot.
        parameters: All of them, with or without friction, shape (n,).

    Raises:
        InputError: If they are not as many, or one is not finite.
    """
    layout = layout_of(subject, parameters)
    parameters = layout.check("parameters", parameters)
    found = []
    for i, rows in enumerate(layout.links):
        found += [f"{layout.link_name(i)}: {reason}" for reason in link_faults(parameters[rows])]
    for rows, what in ((layout.rotors, "rotor inertia"), (layout.friction, "friction")):
        found += [
            f"{layout.names[row]} = {parameters[row]:.6g}: negative {what}"
            for row in rows
            if parameters[row] < 0.0
        ]
    found += [
        f"{layout.names[row]} = {parameters[row]:.6g} kg: must be positive"
        for row in layout.masses
        if parameters[row] <= 0.0
    ]
    return found


def require_consistent(subject: Subject, parameters: np.ndarray) -> None:
    """Refuse parameters that no robot has.

    Args:
        subject: The robot.
        parameters: All of them, with or without friction, shape (n,).

    Raises:
        InputError: If they are not as many, one is not finite, or there are inconsistencies.
    """
    found = inconsistencies(subject, parameters)
    if found:
        more = f"; and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(f"{subject.name}: not physically consistent: {found[0]}{more}")


def layout_of(subject: Subject, parameters: np.ndarray) -> Layout:
    """Return the layout of parameters with friction, or without if they are as many."""
    layout = Layout.of(parameter_names(subject))
    bare = Layout.of(parameter_names(subject, friction=False))
    return bare if np.shape(parameters) == (bare.size,) else layout


def link_mass_matrices(
    regressor: Regressor, parameters: np.ndarray, q: np.ndarray, rotors: bool = False
) -> np.ndarray:
    """Return the mass matrices ``D_E`` of the links, shape (K, N, N).

    Args:
        regressor: Of the robot.
        parameters: All of them, shape (n,). Base parameters work, too, at the places of the
            columns that are kept and zeros elsewhere.
        q: Postures [rad or m], shape (K, N).
        rotors: Whether the rotors' reflected inertia ``D_M`` is added.
    """
    layout, samples, n = Layout.of(regressor.names), len(q), regressor.subject.dimension
    parameters = layout.check("parameters", parameters).copy()
    if not rotors:
        parameters[layout.rotors] = 0.0
    # columns are the torques that unit accelerations take beside gravity
    accelerations = np.vstack([np.zeros(n), np.eye(n)])
    a = np.tile(accelerations, (samples, 1))
    torques = regressor.matrix(np.repeat(q, n + 1, axis=0), np.zeros_like(a), a) @ parameters
    torques = torques.reshape(samples, n + 1, n)
    D = torques[:, 1:] - torques[:, :1]
    return 0.5 * (D + D.transpose(0, 2, 1))


def least_eigenvalue(
    regressor: Regressor, parameters: np.ndarray, rotors: bool = False, seed: int = 0
) -> LeastEigenvalue:
    """Return the least eigenvalue of ``D_E`` over the joint range.

    Random postures within the position limits, of joints without them of a whole turn; then more
    and more closely around the worst. Links with positive definite pseudo-inertias have a positive
    definite mass matrix everywhere; this tells how near it comes, and finds where others fail.

    Args:
        regressor: Of the robot.
        parameters: As in :func:`link_mass_matrices`.
        rotors: Whether the rotors' reflected inertia is added.
        seed: Of the postures.
    """
    first = [random_motion(regressor, seed + i)[0] for i in range(_SEEDS)]
    random, limits = np.random.default_rng(seed), regressor.subject.position_limits
    best = _worst(regressor, parameters, np.vstack(first), rotors)
    radius = np.ptp(np.vstack(first), axis=0)
    for _ in range(_ROUNDS):
        radius = _SHRINK * radius
        nearby = best.q + radius * random.uniform(-0.5, 0.5, (_NEIGHBOURS, best.q.size))
        found = _worst(regressor, parameters, np.clip(nearby, *limits.T), rotors)
        best = min(best, found, key=lambda eigenvalue: eigenvalue.value)
    return best


def _worst(
    regressor: Regressor, parameters: np.ndarray, q: np.ndarray, rotors: bool
) -> LeastEigenvalue:
    eigenvalues = np.linalg.eigvalsh(link_mass_matrices(regressor, parameters, q, rotors))[:, 0]
    worst = int(np.argmin(eigenvalues))
    return LeastEigenvalue(float(eigenvalues[worst]), q[worst])


def central_inertia(parameters: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], centre of mass [m] (3,) and inertia about that [kg m^2] (3, 3).

    Args:
        parameters: The ten of one link, with a mass, shape (10,).
    """
    mass, moment, inertia = link_moments(parameters)
    center = moment / mass
    return mass, center, inertia - mass * (center @ center * np.eye(3) - np.outer(center, center))


def link_faults(parameters: np.ndarray) -> list[str]:
    """Return what is not physical about a link, in words; nothing if it is.

    Args:
        parameters: Its ten, shape (10,).
    """
    if parameters[0] <= 0.0:
        return [f"mass {parameters[0]:.6g} kg; must be positive"]
    low, middle, high = np.linalg.eigvalsh(central_inertia(parameters)[2])
    shown = f"principal moments of inertia [{low:.4g}, {middle:.4g}, {high:.4g}] kg m^2"
    slack = _ROUNDING * abs(np.trace(pseudo_inertia(parameters)[:3, :3]))
    if low < -slack:
        return [f"{shown}; none may be negative"]
    if high > low + middle + slack:
        return [f"{shown}; none may be above the sum of the other two"]
    return []
