"""An operator who does what was written down beforehand."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.physics.force_profile import ForceProfile


class ScriptedForce(Block):
    """Force and torque at the tool point over time, see :class:`ForcePulse`.

    The value is that of the tick. Directions in manifold coordinates are those of the manifold's
    point at the last tick; a point that is not finite leaves them as they were.

    Ports:
        manifold_point (input): Where on the manifold the tool is; only if a pulse is given in
            manifold coordinates.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        The manifold's ``axes`` as columns, one after the other, if they are needed; zero before
        there is a point.

    Args:
        profile: The profile.
        manifold: The manifold that the tool follows.
        period: Sampling time [s].
    """

    def __init__(self, profile: ForceProfile, manifold: Manifold, period: float) -> None:
        self._profile, self._manifold, self._period = profile, manifold, period
        self.inputs, self.states = {}, {}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        if profile.needs_manifold:
            self.inputs["manifold_point"] = Port(manifold.layout.size)
            self.states["axes"] = 9

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return self._seen(u, ca.DM.zeros(9)) if self.states else {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        axes = ca.reshape(x.axes, 3, 3) if self.states else ca.DM.zeros(3, 3)
        return {"wrench": self._profile.at(t * self._period, axes)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return self._seen(u, x.axes) if self.states else {}

    def _seen(self, u: Values, before: Any) -> dict[str, Any]:
        axes = ca.vec(self._manifold.axes(u.manifold_point))
        return {"axes": where(all_finite(axes), axes, before)}
