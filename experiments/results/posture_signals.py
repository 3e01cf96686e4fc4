"""Signals of joints beyond the number of outputs."""

import casadi as ca
import numpy as np

from diagrams.station import Station
from experiments.results.run_log import RunLog
from pfsc_drake import jets


def add_posture(log: RunLog, station: Station, raw: dict[str, np.ndarray], unit: str) -> None:
    """Log the posture reference, the coordinate that is kept, and what damping lets slip.

    Args:
        log: Where to add.
        station: The station.
        raw: Its logged signals, each (samples, size).
        unit: Of joint coordinates.
    """
    law, n = station.law, station.robot.dimension
    residual = raw["law"][:, law.layout.residual]
    if residual.size:
        labels = [coordinate.name for coordinate in law.linearization.manifold.coordinates]
        degree = law.linearization.relative_degree
        log.add("decoupling_residual", residual, f"SI/s^{degree}", labels)
    if "posture_reference" not in raw:
        return
    reference = raw["posture_reference"][:, :n]
    log.add("q_posture", reference, unit, [f"q_posture_{i + 1}" for i in range(n)])
    assert law.posture is not None
    if law.posture.coordinate is None:
        return
    q = ca.SX.sym("q", n)
    angle = law.posture.coordinate([jets.constant(q[i], 1) for i in range(n)]).coefficients[0]
    kept = ca.Function("coordinate", [q], [angle]).map(len(reference))
    swivel = [
        np.unwrap(np.array(kept(x.T)).ravel()) for x in (raw["joint_state"][:, :n], reference)
    ]
    log.add("swivel", np.array(swivel).T, "rad", ["swivel", "swivel_p"])


def posture_signals(station: Station) -> set[str]:
    """Return the signals that :func:`add_posture` logs for a station.

    Args:
        station: The station, simulated or not.
    """
    posture, residual = station.law.posture, station.law.layout.residual
    names = {"decoupling_residual"} if residual.stop > residual.start else set()
    if posture is not None:
        names |= {"q_posture"} if posture.coordinate is None else {"q_posture", "swivel"}
    return names
