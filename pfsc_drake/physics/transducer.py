"""One tick of a force/torque transducer as a compiled function."""

import casadi as ca
import numpy as np

from pfsc_drake.control.estimation.low_pass import LowPass


def transducer_function(
    low_pass: LowPass, bias: np.ndarray, measurement_range: np.ndarray
) -> ca.Function:
    """Return what a sensor makes of its load, ``clip(lowpass(load) + bias + noise)``.

    Args:
        low_pass: The amplifier's filter.
        bias: Reading without load, shape (6,) [N, Nm].
        measurement_range: Largest magnitude that is measured, shape (6,) [N, Nm].

    Returns:
        ``(reaction, state, noise) -> (reading, load, next_state)``, each (6,). The reaction
        is ``[torque, force]`` on the tool, as in Drake, the load ``[force, torque]`` its
        opposite. The filter rests on the load where its state is NaN; a load that is NaN is
        read as NaN.
    """
    reaction, memory, noise = (ca.SX.sym(name, 6) for name in ("reaction", "state", "noise"))
    load = -ca.vertcat(reaction[3:], reaction[:3])
    state = ca.if_else(_is_nan(memory), low_pass.rest(load), memory)
    reading = low_pass.output(state, load) + bias + noise
    # unlike a minimum, a comparison lets NaN through
    reading = ca.if_else(reading > measurement_range, measurement_range, reading)
    reading = ca.if_else(reading < -measurement_range, -measurement_range, reading)
    return ca.Function(
        "transducer",
        [reaction, memory, noise],
        ca.cse([ca.densify(x) for x in (reading, load, low_pass.update(state, load))]),
        ["reaction", "state", "noise"],
        ["reading", "load", "next_state"],
    )


def _is_nan(value: ca.SX) -> ca.SX:
    return ca.logic_not(ca.fabs(value) <= ca.inf)
