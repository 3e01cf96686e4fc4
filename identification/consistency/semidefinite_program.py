"""Semidefinite program for consistent parameters."""

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from identification.consistency.bounds import (
    FrameBox,
    Intervals,
    LinkBounds,
    PhysicalBounds,
    check_bounds,
    extent_terms,
    link_intervals,
    other_intervals,
)
from identification.consistency.pseudo_inertia import (
    SIZE,
    Layout,
    from_pseudo_inertia,
    linear_terms,
    pseudo_inertia,
)
from identification.model.dynamic_parameters import PER_LINK
from pfsc_drake.errors import InputError

# of the largest eigenvalue in units of mass and size; a flatter prior is too strong
_FLATTEST = 1e-9


def prior_from_bounds(names: Sequence[str], bounds: PhysicalBounds) -> np.ndarray:
    """Return a full set of parameters in the middle of the bounds, shape (n,).

    Each link has the geometric mean of its mass bounds and fills the box of its centre of mass
    evenly; bounded rotors have the geometric mean of their bounds. Friction and rotors without
    bounds are
    NaN: nothing is assumed of them. Masses of a DELTA robot are identifiable, and NaN.

    Args:
        names: Names of the n parameters.
        bounds: Bounds of the robot.
    """
    layout = Layout.of(names)
    prior = np.full(layout.size, np.nan)
    for rows, link in zip(layout.links, bounds.links, strict=True):
        prior[rows] = _middle(link)
    for row, interval in zip(layout.rotors, bounds.rotor_inertia, strict=False):
        prior[row] = np.sqrt(np.prod(interval))
    return prior


def check_prior(names: Sequence[str], prior: np.ndarray) -> np.ndarray:
    """Return a prior, such as the robot's CAD data, shape (n,).

    Args:
        names: Names of the n parameters.
        prior: Full set; NaN for parameters without assumption, which no link may have.

    Raises:
        InputError: If the shape differs, or a link does not have the parameters of an extended
            body.
    """
    layout, prior = Layout.of(names), np.asarray(prior, dtype=float)
    if prior.shape != (layout.size,):
        raise InputError(f"prior: shape {prior.shape}; must be ({layout.size},)")
    for i, rows in enumerate(layout.links):
        if not np.all(np.isfinite(prior[rows])):
            raise InputError(f"prior: {layout.link_name(i)} has a parameter that is not finite")
        if not _is_extended(prior[rows]):
            raise InputError(
                f"prior: {layout.link_name(i)} of {prior[rows[0]]:g} kg has no positive definite "
                "pseudo-inertia; allowed: bodies that extend in all directions"
            )
    for row in layout.rotors:
        if prior[row] <= 0.0:
            raise InputError(f"prior: {layout.names[row]} = {prior[row]:g}; must be positive")
    return prior


def _middle(link: LinkBounds) -> np.ndarray:
    mass, center = np.sqrt(np.prod(link.mass)), link.center_of_mass.center
    variance = link.center_of_mass.half_widths**2 / 3.0 + link.least_extent**2
    P = np.empty((SIZE, SIZE))
    P[:3, :3] = np.diag(variance) + np.outer(center, center)
    P[:3, 3] = P[3, :3] = center
    P[3, 3] = 1.0
    return from_pseudo_inertia(mass * P)


def _is_extended(parameters: np.ndarray) -> bool:
    P = pseudo_inertia(parameters)
    if not np.all(np.diag(P) > 0.0):
        return False
    size = np.sqrt(np.trace(P[:3, :3]) / P[3, 3])
    units = np.sqrt(P[3, 3]) * np.array([size, size, size, 1.0])
    return bool(np.linalg.eigvalsh(P / np.outer(units, units))[0] > _FLATTEST)


# of the distance from the prior, in units of squared standard deviations
PRIOR_WEIGHT = 0.1
# lower limit of the uncertainty of any combination of parameters, in units of the prior
_MOST_CERTAIN = 1e6
_TERMS = np.array(linear_terms())


def least_squares(
    A: np.ndarray,
    b: np.ndarray,
    names: Sequence[str],
    bounds: PhysicalBounds,
    prior: np.ndarray | None = None,
    prior_weight: float = PRIOR_WEIGHT,
) -> np.ndarray:
    """Return the consistent parameters ``rho`` nearest to measurements, shape (n,).

    They solve::

        min |A rho - b|^2 + w sum_i d(P_i, P_i0) + w sum_j (I_M,j / I_M0,j - 1)^2
        s.t. P_i - m_i r_i^2 diag(1, 1, 1, 0) >= 0          mass extends by r_i at least
             m_i lower <= h_i <= m_i upper                  centre of mass in its box
             bounds of masses and rotors; I_M, f_c, f_v >= 0

    with the pseudo-inertias P, their blocks Sigma, h, m and the distance d of
    :mod:`~identification.consistency.pseudo_inertia`. The prior determines the parameters that
    torques do not depend on, whatever its weight. With ``P_0 = L L'`` the unknown of each link is
    ``L^-1 P L^-T``, of the order of one; all unknowns are relative to a set that fits the
    measurements without being consistent, so that the cost is of the order of chi squared.
    Combinations known to better than 1e-6 of that unit count as known to 1e-6.

    Args:
        A: Weighted such that b has the unit matrix for its covariance, shape (k, n).
        b: Shape (k,).
        names: Names of the n parameters.
        bounds: Bounds of the robot.
        prior: ``rho_0``, see :func:`check_prior`; by default the middle of the bounds.
        prior_weight: ``w``; 1 weighs the distance like a squared standard deviation.

    Raises:
        InputError: If the bounds contradict each other (names the link) or belong to another robot,
            the prior is not physical, the weight is not positive or no solution is found.
    """
    if not 0.0 < prior_weight < np.inf:
        raise InputError(f"prior_weight = {prior_weight!r}; must be finite and positive")
    layout = Layout.of(names)
    check_bounds(layout, bounds)
    rho_0 = prior_from_bounds(names, bounds) if prior is None else check_prior(names, prior)
    S = _units(layout, rho_0, A)
    start = np.linalg.solve(S, np.where(np.isfinite(rho_0), rho_0, 0.0))
    known, values = _reduce(A @ S, b)
    weak, middle = _prior_rows(layout, rho_0)
    weight = np.sqrt(prior_weight)
    start += np.linalg.lstsq(known, values - known @ start, rcond=None)[0]
    rows = np.vstack([known, weight * weak])
    offset = rows @ start - np.concatenate([values, weight * middle])
    program = MathematicalProgram()
    z = program.NewContinuousVariables(layout.size, "z")
    triangle = np.asarray(np.linalg.qr(np.column_stack([rows, offset]), mode="r"))
    # the length itself, because its square is worse conditioned
    program.AddL2NormCostUsingConicConstraint(triangle[:, :-1], triangle[:, -1], z)
    _add(program, other_intervals(layout, bounds), S, start, z)
    for link_rows, link in zip(layout.links, bounds.links, strict=True):
        block = S[np.ix_(link_rows, link_rows)]
        _add_link(program, link, block, start[link_rows], z[link_rows])
    result = ClarabelSolver().Solve(program)
    if not result.is_success():
        _explain(result.get_solution_result().name, layout, bounds)
    parameters = S @ (start + result.GetSolution(z))
    not_negative = np.concatenate([layout.rotors, layout.friction])
    parameters[not_negative] = np.maximum(parameters[not_negative], 0.0)
    return np.asarray(parameters)


def _reduce(A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return as few rows with the same squares up to a constant, none of them too certain."""
    U, sizes, Vt = np.linalg.svd(A, full_matrices=False)
    certain = np.minimum(sizes, _MOST_CERTAIN)
    share = np.divide(certain, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    return certain[:, None] * Vt, share * (U.T @ b)


def _prior_rows(layout: Layout, rho_0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and right side of the distance from the prior, in units of the prior."""
    rows, right = [], []
    for link in layout.links:
        block = np.zeros((SIZE**2, layout.size))
        block[:, link] = np.sqrt(0.5) * _TERMS.reshape(PER_LINK, -1).T
        rows.append(block)
        right.append(np.sqrt(0.5) * np.eye(SIZE).ravel())
    for row in layout.rotors[np.isfinite(rho_0[layout.rotors])]:
        rows.append(np.eye(1, layout.size, row))
        right.append(np.ones(1))
    return np.vstack([np.zeros((0, layout.size)), *rows]), np.concatenate([np.zeros(0), *right])


def _units(layout: Layout, rho_0: np.ndarray, A: np.ndarray) -> np.ndarray:
    """Return S of ``rho = S z`` with unknowns of the order of one, shape (n, n)."""
    norms = np.linalg.norm(A, axis=0)
    S = np.diag(np.divide(1.0, norms, out=np.ones(layout.size), where=norms > 0.0))
    for rows in layout.links:
        L = np.linalg.cholesky(pseudo_inertia(rho_0[rows]))
        columns = [from_pseudo_inertia(L @ term @ L.T) for term in _TERMS]
        S[np.ix_(rows, rows)] = np.transpose(columns)
    known = layout.rotors[np.isfinite(rho_0[layout.rotors])]
    S[known, known] = rho_0[known]
    return S


def _add(
    program: MathematicalProgram,
    intervals: Intervals,
    S: np.ndarray,
    start: np.ndarray,
    z: np.ndarray,
) -> None:
    """Add intervals of ``rho = S (start + z)``."""
    rows, least, most = intervals
    G = rows @ S
    sizes = np.abs(G).max(axis=1)
    offset = G @ start
    lower, upper = (least - offset) / sizes, (most - offset) / sizes
    program.AddLinearConstraint(G / sizes[:, None], lower, upper, z)


def _add_link(
    program: MathematicalProgram,
    link: LinkBounds,
    S: np.ndarray,
    start: np.ndarray,
    z: np.ndarray,
) -> None:
    """Add the constraints of a link with ``rho = S (start + z)``."""
    _add(program, link_intervals(link), S, start, z)
    P_0 = pseudo_inertia(S @ _identity())
    inverse = np.linalg.inv(np.linalg.cholesky(P_0))
    terms = inverse @ np.tensordot(S.T, extent_terms(link), 1) @ inverse.T
    terms = 0.5 * (terms + terms.transpose(0, 2, 1))
    program.AddLinearMatrixInequalityConstraint([np.tensordot(start, terms, 1), *terms], z)


def _identity() -> np.ndarray:
    return from_pseudo_inertia(np.eye(SIZE))


def _explain(outcome: str, layout: Layout, bounds: PhysicalBounds) -> NoReturn:
    """Raise the InputError of a program that was not solved."""
    prior = prior_from_bounds(layout.names, bounds)
    S = _units(layout, prior, np.zeros((1, layout.size)))
    for i, (rows, link) in enumerate(zip(layout.links, bounds.links, strict=True)):
        program = MathematicalProgram()
        z = program.NewContinuousVariables(PER_LINK)
        _add_link(program, link, S[np.ix_(rows, rows)], np.zeros(PER_LINK), z)
        if not ClarabelSolver().Solve(program).is_success():
            body = "" if link.body is None else f", all of it {_box_text(link.body)}"
            raise InputError(
                f"bounds of {bounds.name}: {layout.link_name(i)}: no body of {link.mass} kg has "
                f"its centre of mass {_box_text(link.center_of_mass)}{body} and spreads by "
                f"{link.least_extent:g} m"
            )
    masses = np.sum([link.mass for link in bounds.links], axis=0)
    total = bounds.total_mass
    if total and (masses[0] > total[1] or masses[1] < total[0]):
        raise InputError(
            f"bounds of {bounds.name}: total_mass = {total}; the links have {masses[0]:g} to "
            f"{masses[1]:g} kg together"
        )
    raise InputError(
        f"bounds of {bounds.name}: no consistent parameters found ({outcome}); allowed: bounds "
        "and measurements of one robot"
    )


def _box_text(box: FrameBox) -> str:
    return f"between {box.lower.tolist()} and {box.upper.tolist()} m"
