"""Following law as a block with states."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.control.law.exact_linearization import Relation
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw, LawLayout
from pfsc_drake.control.law.rest_hold import RestHold, reference_rests
from pfsc_drake.control.manifolds.moving_frame import MovingFrameManifold


class SampledLaw(Block):
    """A :class:`FollowingLaw` with its states.

    With the virtual output ``yhat`` and relative degree r the closed loop is
    ``e^(r) + a_r e^(r-1) + ... + a_1 e + a_0 int e = 0``, ``e = yhat - yhat_p``.

    The integral is constant while a drive is at its limit or torques are held. After a fault the
    states do not change.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): Point of the manifold closest to the tool.
        relation (input): Relation of drives and virtual output, from :class:`ExactLinearization`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,).
        tau_ext (input, optional): External joint torques and their derivatives up to order
            r - 2 by rows [Nm or N, per s, ..], shape ((r - 1) N,); zero if not connected.
            Only for r > 1.
        friction_torque (input, optional): ``tau_f`` to be compensated [Nm or N], shape (N,); zero
            if not connected. Only for r > 1.
        posture_reference (input): Derivatives 0..r of the posture reference by rows, shape
            ((r + 1) N,); only for redundant joints.
        stopping (input): Nonzero from a fault on, shape (1,); acts on the next states.
        evaluation (output): Laid out by the law's ``layout``.
        manifold_state (output): Derivatives 0..r-1 of ``yhat`` by rows, shape (r m,).
        virtual_input (output): ``v``, shape (m,).
        fault (output): Fault of the law, shape (1,).
        input_fault (output): The same if an input is not finite, else 0, shape (1,).
        reference_velocity (output): Joint velocities of the reference at the last sample, shape
            (N,) [rad/s or m/s], zero before; only of a law with them. It depends on the state
            alone: inputs of the law may depend on it.

    State:
        ``integral`` of the error, shape (m,); ``held``, the part of the drive input that is
        extrapolated over the hold, shape (N,), and whether it is ``known``; virtual ``output`` of
        the last sample, shape (m,); ``reference_velocity``, if the law has it; states of
        :class:`RestHold`, with a hold.

    Args:
        law: The law.
        period: Sampling time [s].
        hold: Hold of the torques of sticking drives; none if omitted.
    """

    def __init__(self, law: FollowingLaw, period: float, hold: RestHold | None = None) -> None:
        self._law, self._period, self._hold = law, period, hold
        linearization, layout = law.linearization, law.layout
        n, m = linearization.num_joints, linearization.num_outputs
        r = linearization.relative_degree
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "manifold_point": Port(linearization.manifold.layout.size),
            "relation": Port(Relation.size(linearization)),
            "reference": Port((r + 1) * m, "m or rad, per s, .."),
            "stopping": Port(1),
        }
        if r > 1:
            self.inputs["tau_ext"] = Port((r - 1) * n, "Nm or N, per s, ..", optional=True)
            self.inputs["friction_torque"] = Port(n, "Nm or N", optional=True)
        if law.posture is not None:
            self.inputs["posture_reference"] = Port((r + 1) * n, "rad or m, per s, ..")
        self.outputs = {
            "evaluation": Port(layout.size),
            "manifold_state": Port(r * m, "m or rad, per s, .."),
            "virtual_input": Port(m),
            "fault": Port(1),
            "input_fault": Port(1),
        }
        self.states = {"integral": m, "held": n, "known": 1, "output": m}
        if hold is not None:
            self.states |= hold.states(n, m)
            self.inner = {"holds": 1} | {f"next_{k}": size for k, size in hold.states(n, m).items()}
        self._has_velocity = layout.reference_velocity.stop > layout.reference_velocity.start
        if self._has_velocity:
            self.outputs["reference_velocity"] = Port(n, "rad/s or m/s")
            self.states["reference_velocity"] = n

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        law, layout = self._law, self._law.layout
        arguments = {
            "state": u.joint_state,
            "manifold_point": u.manifold_point,
            "relation": u.relation,
            "reference": u.reference,
            "integral": x.integral,
            "last_varying_input": x.held,
            "known": x.known,
            "last_output": x.output,
            "tau_ext": getattr(u, "tau_ext", None),
            "friction": getattr(u, "friction_torque", None),
            "posture": getattr(u, "posture_reference", None),
        }
        connected = {name: value for name, value in arguments.items() if value is not None}
        result = law.function(**connected)["result"]
        fault = result[layout.status.start]
        outputs = {
            "evaluation": result,
            "manifold_state": result[layout.manifold_state],
            "virtual_input": result[layout.virtual_input],
            "fault": fault,
            "input_fault": where(fault == Fault.INPUT_NOT_FINITE, fault, Fault.NONE),
        }
        if self._has_velocity:
            outputs["reference_velocity"] = x.reference_velocity
        if self._hold is not None:
            m, n = x.output.shape[0], x.held.shape[0]
            error = result[layout.manifold_state][:m] - u.reference[:m]
            q_M, drive = u.joint_state[2 * n : 3 * n], result[layout.drive]
            friction = getattr(u, "friction_torque", None)
            friction = ca.DM.zeros(n) if friction is None else friction
            manifold = law.linearization.manifold
            posture_rate = frame_rate = None
            if law.posture is not None:
                posture_rate = u.posture_reference[n : 2 * n]
            if isinstance(manifold, MovingFrameManifold):
                frame_rate = manifold.frame_rate(u.manifold_point)
            rests = reference_rests(u.reference[m:], posture_rate, frame_rate)
            holds, drive, next_states = self._hold.step(x, q_M, rests, error, drive, friction)
            outputs["evaluation"] = ca.vertcat(drive, result[layout.drive.stop :])
            outputs |= {"holds": holds} | {
                f"next_{name}": value for name, value in next_states.items()
            }
        return outputs

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        law, layout = self._law, self._law.layout
        m = x.output.shape[0]
        output, saturated = y.manifold_state[:m], y.evaluation[layout.status.stop - 1]
        # if the point moves with time, the virtual output is the error
        follows_time = law.linearization.manifold.follows_time
        error = output if follows_time else output - u.reference[:m]
        later = {
            "held": y.evaluation[layout.varying_input],
            "known": ca.DM(1),
            "output": output,
        }
        if law.stabilization.has_integral_part:
            waits = saturated if self._hold is None else ca.logic_or(saturated, y.holds)
            later["integral"] = x.integral + where(waits, 0.0, self._period * error)
        if self._hold is not None:
            later |= {name: getattr(y, f"next_{name}") for name in self._hold.states(1, 1)}
        if self._has_velocity:
            later["reference_velocity"] = y.evaluation[layout.reference_velocity]
        return {name: where(u.stopping, getattr(x, name), new) for name, new in later.items()}


class LawReport(Block):
    """Result of a sample for logs: result of the law with fault and commands to the drives.

    Ports:
        evaluation (input): Laid out by the law's ``layout``.
        fault (input): Fault that stops the robot, shape (1,), 0 for none.
        command (input): Commands to the drives, shape (N,).
        law (output): The evaluation with fault and commands.
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).

    Args:
        layout: Layout of the result.
    """

    def __init__(self, layout: LawLayout) -> None:
        self._layout, drives = layout, layout.drive.stop - layout.drive.start
        self.inputs = {"evaluation": Port(layout.size), "fault": Port(1), "command": Port(drives)}
        self.outputs, self.states = {"law": Port(layout.size), "status": Port(3)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        status = self._layout.status
        between = u.evaluation[self._layout.drive.stop : status.start]
        law = ca.vertcat(u.command, between, u.fault, u.evaluation[status.start + 1 :])
        return {"law": law, "status": law[status]}
