"""An impedance law on arrays, a row for each quantity."""

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.compliance.impedance import ImpedanceLaw, ImpedanceState, ImpedanceStatus


class ImpedanceOnNumbers:
    """The law's expressions as functions; states are y_p, y_p', force and impedance, (6, m).

    Args:
        arguments: Of the law.
        options: Of the law.
    """

    def __init__(self, *arguments, **options):
        self.law = ImpedanceLaw(*arguments, **options)
        self.period, self.desired_order = self.law.period, self.law.desired_order
        self.m = m = self.law.num_outputs
        state, force, impedance_values = (
            ca.SX.sym("x", 6 * m),
            ca.SX.sym("tau", m),
            ca.SX.sym("z", 3 * m),
        )
        desired, y = ca.SX.sym("y_d", (self.desired_order + 1) * m), ca.SX.sym("y", m)
        now = ImpedanceState(state[:m], state[m : 2 * m], state[2 * m : 3 * m], state[3 * m :])
        later, status = self.law.update(now, desired, force, impedance_values)
        reference = self.law.reference(now, desired)
        self._update = _function(
            [state, desired, force, impedance_values], [ca.vertcat(*later), status]
        )
        self._reference = _function([state, desired], [reference])
        self._impedance = _function([y], [self.law.impedance(y)])

    def _call(self, function, *values):
        for argument, value in zip(function.arguments.values(), values, strict=True):
            argument[:] = np.ravel(value)
        function.evaluate()
        return [result.copy() for result in function.results.values()]

    def impedance(self, y):
        """Return rows mass, damping, stiffness, shape (3, m)."""
        return self._call(self._impedance, y)[0].reshape(3, -1)

    def start(self, motion):
        """Return a state, shape (6, m)."""
        state = ca.vertcat(*self.law.start(ca.DM(np.ravel(motion))))
        return ca.DM(state).full().reshape(6, -1)

    def update(self, state, desired, force, impedance):
        """Return the next state, shape (6, m), and the status."""
        later, status = self._call(self._update, state, desired, force, impedance)
        return later.reshape(6, -1), ImpedanceStatus(int(status[0]))

    def reference(self, state, desired):
        """Return derivatives of y_p by rows, shape (r + 1, m)."""
        return self._call(self._reference, state, desired)[0].reshape(-1, self.m)

    def push_to(self, state, speed, force, free):
        """Return the force after which some coordinates have other speeds, shape (m,)."""
        rows = ca.vertsplit(ca.DM(state.ravel()), self.m)
        now = ImpedanceState(*rows[:3], ca.vertcat(*rows[3:]))
        return self.law.push_to(now, ca.DM(speed), ca.DM(force), free).full().ravel()


def _function(arguments, results):
    return BoundFunction(ca.Function("f", arguments, [ca.densify(ca.SX(x)) for x in results]))
