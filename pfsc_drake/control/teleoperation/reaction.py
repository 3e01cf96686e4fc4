"""What a tool that is led within regions feels of them, for whoever leads it elsewhere."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord


class FixtureReaction(Block):
    """Where guidance has the tool, and what regions and surroundings do to it.

    Ports:
        record (input): Of the guidance, see :class:`GuidanceRecord`.
        wrench (input, optional): Of the surroundings on the tool as measured, shape (6,) [N, Nm].
        position (output): ``z`` [m], shape (3,), the last one that was finite.
        felt (output): ``f + sum phi_i n_i`` [N], shape (3,).

    State:
        last: ``z`` [m].

    Args:
        num_regions: M.
    """

    def __init__(self, num_regions: int) -> None:
        self._record = GuidanceRecord(num_regions)
        self.inputs = {
            "record": Port(self._record.size),
            "wrench": Port(6, "N, Nm", optional=True),
        }
        self.outputs = {"position": Port(3, "m"), "felt": Port(3, "N")}
        self.states = {"last": 3}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        z, near = (u.record[self._record.fields[name]] for name in ("point", "near"))
        slots = ca.reshape(near, len(SLOT), -1).T
        n = slots[:, SLOT.index("n_x") : SLOT.index("n_z") + 1]
        felt = n.T @ slots[:, SLOT.index("phi")]
        if u.wrench is not None:
            felt += u.wrench[:3]
        known = all_finite(z, felt)
        return {"position": where(known, z, x.last), "felt": where(known, felt, 0.0)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"last": y.position}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"last": u.record[self._record.fields["point"]]}
