"""Couplings of leader and follower over a channel: felt, stable, passive."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from experiments.studies.study_page import write_study_page
from experiments.studies.teleoperation.pictures import draw_contact, draw_energies, draw_felt
from experiments.studies.teleoperation.point import PointStation, PointTeleoperation
from experiments.studies.teleoperation.sequences import Energy, run_sequences
from experiments.studies.teleoperation.transparency import WALL, Felt, felt_at, press, wave_theory
from pfsc_drake.control.teleoperation.parameters import CouplingParameters
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import STYLE, render

DELAYS = (0.0, 0.025, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
CONTACT_DELAY = 0.2  # s
# sharp and blunt edges with the first, behind which the wall of transparency is
PLANES: list[tuple[list[float], list[float]]] = [
    ([WALL, 0.0, 0.0], [-1.0, 0.0, 0.0]),
    ([0.0, 0.08, 0.0], [0.0, -1.0, 0.0]),
    ([0.0, 0.0, -0.1], [0.5, 0.0, float(np.sqrt(0.75))]),
]
_IMPEDANCE, _SMOOTHING, _JITTER_SMOOTHING = 60.0, 0.002, 0.015
_PLAIN = {
    "waves": CouplingParameters(impedance=_IMPEDANCE, smoothing=_SMOOTHING),
    "position-force": CouplingParameters("position_force", passive=False, smoothing=_SMOOTHING),
    "four-channel": CouplingParameters("four_channel", passive=False, smoothing=_SMOOTHING),
    "four-channel, passive": CouplingParameters("four_channel", smoothing=_SMOOTHING),
}
_SEQUENCES = {
    "waves": CouplingParameters(impedance=_IMPEDANCE, smoothing=_JITTER_SMOOTHING),
    "position-force, passive": CouplingParameters("position_force", smoothing=_JITTER_SMOOTHING),
    "four-channel, passive": CouplingParameters("four_channel", smoothing=_JITTER_SMOOTHING),
    "waves, not passive": CouplingParameters(
        passive=False, impedance=_IMPEDANCE, smoothing=_JITTER_SMOOTHING
    ),
    "position-force": CouplingParameters(
        "position_force", passive=False, smoothing=_JITTER_SMOOTHING
    ),
    "four-channel": CouplingParameters("four_channel", passive=False, smoothing=_JITTER_SMOOTHING),
}
_OTHERS = 0.1  # share of the sequences that others than passive waves get
_DURATION = 4.0  # s
_DESCRIPTION = (
    "A hand holds a leader of 0.35 kg with friction and encoders; a point of 2 kg and 40 N s/m "
    "behind velocity servos follows among three planes that it cannot cross. Felt: a hand moves "
    "to and fro at 0.5 Hz, and presses the point to a plane. Where the force at the wall does not "
    "come to rest no stiffness is shown. Random sequences: hands of up to 600 N/m that want "
    "elsewhere, push and tremble, delays of up to 0.5 s each way, jitter of up to 0.1 s, up to "
    "half of the messages lost, walls of up to 2 kN/m. The coupling's bound: what it took from "
    "hand and follower is never below minus what its tanks held."
)


def write_teleoperation(
    out: Path,
    progress: Callable[[str], None],
    delays: Sequence[float] = DELAYS,
    sequences: int = 1000,
) -> Report:
    """Compare couplings by delay, at a wall, and with random hands, and write a page.

    Args:
        out: Folder for the page.
        progress: Told what is done, in lines.
        delays: Of the channel, each way [s].
        sequences: Number of random runs of passive waves; others get a tenth.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page; nothing has been run then.
    """
    with open_results(out, "study") as results:
        felt: dict[str, list[Felt]] = {}
        contact = {}
        for name, coupling in _PLAIN.items():
            progress(f"{name}: what is felt")
            station = PointTeleoperation(PointStation(coupling, PLANES[:1]))
            felt[name] = [felt_at(station, delay) for delay in delays]
            contact[name] = press(station, CONTACT_DELAY)
        energies = {
            name: _sequences(name, coupling, sequences, progress)
            for name, coupling in _SEQUENCES.items()
        }
        theory = wave_theory(PointStation(_PLAIN["waves"]), delays)
        metrics = _metrics(delays, felt, theory, energies)
        with plt.rc_context(STYLE):
            figures = [
                render(draw_felt(delays, felt, theory)),
                render(draw_contact(contact, CONTACT_DELAY)),
                render(draw_energies(energies)),
            ]
        return write_study_page(
            results,
            title="Teleoperation over a channel",
            description=_DESCRIPTION,
            overrides=[f"{name}: {coupling}" for name, coupling in _SEQUENCES.items()],
            metrics=metrics,
            figures=figures,
        )


def _sequences(
    name: str, coupling: CouplingParameters, sequences: int, progress: Callable[[str], None]
) -> list[Energy]:
    """Return the energies of random runs."""
    first = next(iter(_SEQUENCES))
    count = sequences if name == first else max(1, round(_OTHERS * sequences))
    progress(f"{name}: {count} random sequences")
    station = PointTeleoperation(PointStation(coupling, PLANES))
    told = lambda done: progress(f"{name}: {done} of {count}")  # noqa: E731
    return run_sequences(station, PLANES, count, _DURATION, told)


def _metrics(
    delays: Sequence[float],
    felt: Mapping[str, Sequence[Felt]],
    theory: tuple[np.ndarray, np.ndarray],
    energies: Mapping[str, Sequence[Energy]],
) -> Metrics:
    metrics = Metrics()
    for name, rows in felt.items():
        for delay, row in zip(delays, rows, strict=True):
            at = f"{name}, {1e3 * delay:g} ms"
            metrics.add(f"{at}: felt_impedance", row.impedance, "N s/m")
            metrics.add(f"{at}: felt_stiffness", row.stiffness, "N/m")
            metrics.add(f"{at}: unsteady_force", row.unsteady, "N")
    waves = felt["waves"]
    off = [row.impedance / z - 1.0 for row, z in zip(waves, theory[0], strict=True)]
    metrics.add("waves: felt_impedance_beside_theory", float(np.max(np.abs(off))), "1")
    for name, runs in energies.items():
        coupling = np.array([run.coupling for run in runs])
        metrics.add(f"{name}: sequences", float(len(runs)), "1")
        metrics.add(f"{name}: sequences_below_bound", float(np.sum(coupling < 0.0)), "1")
        metrics.add(f"{name}: least_above_bound", float(coupling.min()), "J")
        metrics.add(f"{name}: least_tank", min(run.tank for run in runs), "J")
        metrics.add(f"{name}: deepest_violation", max(run.deepest for run in runs), "m")
        metrics.add(f"{name}: fastest_handle", max(run.fastest for run in runs), "m/s")
    return metrics
