"""Exact input-output linearization of a robot along a manifold, compiled once."""

from dataclasses import dataclass

import casadi as ca

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.actuation import DriveState, joint_jets
from pfsc_drake.control.law.laws import LAWS, ActuationOptions
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, RobotModel

# sampling intervals from the begin of a hold to its middle
_MIDDLE = 0.5


@dataclass(frozen=True)
class Linearization:
    """Affine relation between the drives and the virtual output's r-th derivative.

    ``yhat^(r) = A q^(r) + b`` and ``u = gain q^(r) + drift + offset``.

    Attributes:
        function: CasADi function ``(state, tau_ext, manifold_point) -> (Y, A, b, gain,
            drift, offset, motion)``; for manifolds that follow time with a fourth argument,
            the derivatives 0..r of the references of the k tangential coordinates by rows, shape
            ((r + 1) k,).
            ``state`` is ``[q_J, v_J, q_M, v_M]``, shape (4N,); ``tau_ext`` holds the
            external torques and their derivatives up to order r - 2, shape
            (N max(r - 1, 0),). ``Y`` holds the derivatives 0..r-1 of the virtual output in
            its columns, shape (m, r), ``motion`` the derivatives of the joint coordinates, (N, r).
        relative_degree: ``r``.
        manifold: The manifold, with the layout of its point.
        num_joints: ``N``.
        lead: Extrapolation of ``gain q^(r) + drift`` in sampling intervals: to the middle of the
            interval (``elastic``; ``rigid`` by choice) or to its end (``visco_elastic``).
        velocity: Part of the state with ``q'`` of the linearized motion: ``v_J``, or ``v_M`` if the
            law acts on motors.
    """

    function: ca.Function
    relative_degree: int
    manifold: Manifold
    num_joints: int
    lead: float
    velocity: slice

    @property
    def num_outputs(self) -> int:
        """Number of coordinates of the virtual output ``m``."""
        return len(self.manifold.coordinates)

    @property
    def is_redundant(self) -> bool:
        """Whether there are more joints than outputs."""
        return self.num_joints > self.num_outputs


def linearize(
    robot: RobotModel,
    law: str,
    manifold: Manifold,
    options: ActuationOptions | None = None,
) -> Linearization:
    """Derive the linearization of a robot along a manifold.

    For a path it is (3.28), (3.50), (3.57), (3.64); for a trajectory along the path, the computed
    torque law (Sec. 3.8.4).

    Args:
        robot: The robot.
        law: Actuation model of the law, a key of ``LAWS``.
        manifold: Manifold to follow; its order is the relative degree of the law.
        options: Options of the actuation model.

    Raises:
        InputError: If the law is unknown, or does not suit the robot or the manifold.
    """
    options = options or ActuationOptions()
    if law not in LAWS:
        raise InputError(f"law '{law}': unknown; allowed are {', '.join(LAWS)}")
    record = LAWS[law]
    if options.leads_torque and not record.can_lead:
        leading = [name for name, known in LAWS.items() if known.can_lead]
        raise InputError(f"law '{law}': torques lead with the law '{leading[0]}' only")
    r, n, m = record.relative_degree, robot.dimension, len(manifold.coordinates)
    if manifold.layout.order != r:
        raise InputError(
            f"law '{law}': manifold of order {manifold.layout.order}; must be {r}, the relative "
            "degree of the law"
        )
    if n < m:
        names = ", ".join(coordinate.name for coordinate in manifold.coordinates)
        raise InputError(
            f"law '{law}': {n} joints for {m} outputs ({names}); there must be as many or more"
        )
    lead = _MIDDLE if options.leads_torque else record.lead
    ahead = lead if options.sampling_time > 0.0 else 0.0
    on_motors = record.on_motors and not robot.is_rigid
    velocity = slice(3 * n, 4 * n) if on_motors else slice(n, 2 * n)
    function = _linearizing_function(robot, law, manifold, options)
    return Linearization(function, r, manifold, n, ahead, velocity)


@once_per_content()
def _linearizing_function(
    robot: RobotModel, law: str, manifold: Manifold, options: ActuationOptions
) -> ca.Function:
    """Return the function of a :class:`Linearization`."""
    r, n = LAWS[law].relative_degree, robot.dimension
    state, tau_ext = ca.SX.sym("state", 4 * n), ca.SX.sym("tau_ext", n * max(r - 1, 0))
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    progress = ca.SX.sym("progress", (r + 1) * tangential_count(manifold))
    external = ca.vertsplit(tau_ext, n) if r > 1 else []
    q_J, v_J, q_M, v_M = ca.vertsplit(state, n)
    motion = LAWS[law].drive(robot, DriveState(q_J, v_J, q_M, v_M, external), options)
    rows = [ca.vertsplit(row) for row in ca.vertsplit(progress, tangential_count(manifold))]
    lead = [Jet.from_derivatives(column) for column in zip(*rows, strict=True)]

    def virtual_output(derivatives: list[ca.SX]) -> list[Jet]:
        y, R_e = robot.tool_pose(joint_jets(derivatives))
        return manifold.virtual_output(y, R_e, point, lead)

    output = virtual_output([*motion.q, ca.SX(n, 1)])
    Y = ca.horzcat(*[ca.vertcat(*[y.derivative(k) for y in output]) for k in range(r)])
    b = ca.vertcat(*[y.derivative(r) for y in output])
    # A = d yhat / dq (3.22): the virtual output's rate is affine in q'
    rate = ca.SX.sym("rate", n)
    slopes = ca.vertcat(*[y.coefficients[1] for y in virtual_output([motion.q[0], rate])])
    A = ca.jacobian(slopes, rate)
    results = [Y, A, b, motion.gain, motion.drift, motion.offset, ca.horzcat(*motion.q)]
    return ca.Function(
        f"{manifold.name}_{law}",
        [state, tau_ext, point, *([progress] if manifold.follows_time else [])],
        [ca.densify(e) for e in ca.cse(results)],
        ["state", "tau_ext", "manifold_point", *(["progress"] if manifold.follows_time else [])],
        ["Y", "A", "b", "gain", "drift", "offset", "motion"],
        MAY_BE_PARAMETRIC,
    )


@once_per_content()
def decoupling_function(robot: RobotModel, manifold: Manifold) -> ca.Function:
    """Return the decoupling matrix ``A = d yhat / dq`` (3.22) of any posture.

    Args:
        robot: The robot.
        manifold: Manifold to follow; A does not depend on the speed of one that follows time.

    Returns:
        CasADi function ``(q, manifold_point) -> A``, shapes (N,), (size,) and (m, N).
    """
    q, rate = ca.SX.sym("q", robot.dimension), ca.SX.sym("rate", robot.dimension)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    y, R_e = robot.tool_pose(joint_jets([q, rate]))
    output = manifold.virtual_output(y, R_e, point, _references_at_rest(manifold))
    slopes = ca.jacobian(ca.vertcat(*[x.coefficients[1] for x in output]), rate)
    return ca.Function(
        "decoupling", [q, point], ca.cse([ca.densify(slopes)]), ["q", "manifold_point"], ["A"]
    )


@once_per_content()
def virtual_output_function(robot: RobotModel, manifold: Manifold) -> ca.Function:
    """Return the virtual output and its rate of any joint motion.

    Args:
        robot: The robot.
        manifold: A manifold that does not follow time.

    Returns:
        CasADi function ``(q, v, manifold_point) -> Y``, shapes (N,), (N,), (size,) and (m, 2).
    """
    q, v = ca.SX.sym("q", robot.dimension), ca.SX.sym("v", robot.dimension)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    y, R_e = robot.tool_pose(joint_jets([q, v]))
    output = manifold.virtual_output(y, R_e, point, _references_at_rest(manifold))
    Y = ca.horzcat(*[ca.vertcat(*[x.derivative(k) for x in output]) for k in range(2)])
    return ca.Function("virtual_output", [q, v, point], [ca.densify(Y)])


def tangential_count(manifold: Manifold) -> int:
    """Return the number of tangential coordinates of a manifold."""
    return sum(coordinate.kind is Kind.TANGENTIAL for coordinate in manifold.coordinates)


def _references_at_rest(manifold: Manifold) -> list[Jet]:
    """Return references of tangential coordinates at rest at zero."""
    return [Jet([ca.SX(0)] * (manifold.layout.order + 1))] * tangential_count(manifold)
