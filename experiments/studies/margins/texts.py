"""Sentences, metrics and JSON of a margin analysis."""

import json
import math
from dataclasses import asdict
from typing import Any

import numpy as np

from experiments.studies.margins.loop import STIFFEST
from experiments.studies.margins.result import (
    Case,
    MarginAnalysis,
    OperatingPoint,
)
from experiments.studies.margins.sticking import sticking_sentence
from experiments.studies.margins.walk import TouchedSurface
from pfsc_drake.control.margins import DiscMargin
from reporting.metrics import Metrics

# least disc margin and damping ratio of a robust, well-damped loop
GOOD_DISC, GOOD_DAMPING = 0.75, 0.3
_WHAT_TO_DO = (
    ": one additional sampling interval makes the loop unstable; slower poles or a shorter "
    "controller.sampling_time increase the margin"
)
_PARAMETERS = {
    "mass": "the masses",
    "stiffness": "the joint stiffnesses",
    "rotor_inertia": "the rotor inertias",
    "tool_mass": "the tool's mass",
    "unknown_mass": "the mass below the force sensor",
}


def sentences(analysis: MarginAnalysis) -> list[str]:
    """Return the summary in sentences, the most important first.

    Args:
        analysis: The analysis.
    """
    return [
        _nominal(analysis.nominal),
        _box(analysis),
        *_parameters(analysis),
        *_drives(analysis),
        *_touched(analysis.surface),
        *([] if analysis.stuck is None else [sticking_sentence(analysis.stuck)]),
        *analysis.remarks,
    ]


def one_line(analysis: MarginAnalysis) -> str:
    """Return the margins of a loop in one line.

    Args:
        analysis: The analysis.
    """
    tightest = analysis.tightest
    verdict = "stable" if analysis.nominal.is_stable else "UNSTABLE"
    parts = [f"{verdict} {_where(analysis.nominal.worst)}, {_mode(analysis.nominal)}"]
    if tightest is not None and analysis.nominal.is_stable:
        drive = int(np.argmin([margin.alpha for margin in tightest.drives]))
        parts.append(
            f"drive {drive + 1} tolerates {_gain_and_phase(tightest.drives[drive])}; "
            f"{_delay(analysis.delay)}"
        )
    unstable = [case for case in analysis.cases[1:] if not case.is_stable]
    if unstable and analysis.nominal.is_stable:
        worst = max(unstable, key=lambda case: case.worst.rate)
        parts.append(f"unstable with {worst.error}")
    elif len(analysis.cases) > 1:
        parts.append(f"model errors: slowest {_rate(analysis.weakest.worst.rate)}")
    return "; ".join(parts)


def metrics_of(analysis: MarginAnalysis) -> Metrics:
    """Return the numbers of an analysis.

    Args:
        analysis: The analysis.
    """
    result = Metrics()
    result.add("slowest_rate", analysis.nominal.worst.rate, "1/s", "< 0", "model of the scenario")
    damped = analysis.least_damped
    if damped is not None:
        result.add("smallest_damping", damped.damping, "1", source=_where(damped))
    if len(analysis.cases) > 1:
        weakest = analysis.weakest
        result.add(
            "slowest_rate_in_box", weakest.worst.rate, "1/s", "< 0", source=str(weakest.error)
        )
    surface = analysis.surface
    if surface is not None:
        stiffness = surface.stiffness
        result.add("surface_stiffness", stiffness, "N/m", source="of the contact, as a spring")
        if math.isfinite(surface.largest_factor):
            most = surface.largest_factor * stiffness
            result.add("borne_stiffness", most, "N/m", source=surface.instant.location)
    if (stuck := analysis.stuck) is not None:
        presliding = f"presliding {1e6 * stuck.presliding:g} urad"
        source = f"{presliding}, torques are held instead" if stuck.held else presliding
        result.add("stuck_rate", stuck.rate, "1/s", None if stuck.held else "< 0", source)
    tightest = analysis.tightest
    if tightest is not None:
        margin = min(tightest.drives, key=lambda margin: margin.alpha)
        result.add("disc_margin", margin.alpha, "1", source=tightest.instant.location)
        result.add("gain_margin", margin.gain[1], "1", source="of the weakest drive, both signs")
        result.add("phase_margin", margin.phase, "rad", source="of the weakest drive")
        common = min(margins.common.alpha for margins in analysis.margins)
        result.add("disc_margin_of_all_drives", common, "1", source="common factor")
        result.add(
            "delay_margin", analysis.delay, "samples", source="additional delay of all drives"
        )
    return result


def margins_json(analysis: MarginAnalysis) -> str:
    """Return an analysis as JSON; infinity and NaN are null.

    Args:
        analysis: The analysis.
    """
    content = {
        "sampling_time": analysis.period,
        "drives": list(analysis.joints),
        "summary": sentences(analysis),
        "stuck_drives": None if analysis.stuck is None else asdict(analysis.stuck),
        "loops": [_case_data(case) for case in analysis.cases],
        "margins": [
            {
                **_instant_data(margins),
                "disc_margins": [margin.alpha for margin in margins.drives],
                "frequencies_rad_s": [margin.frequency for margin in margins.drives],
                "disc_margin_of_all_drives": margins.common.alpha,
                "delay_margin_samples": margins.delay,
            }
            for margins in analysis.margins
        ],
    }
    return json.dumps(_finite(content), indent=2, allow_nan=False) + "\n"


def _nominal(case: Case) -> str:
    if case.is_stable:
        return f"The scenario's loop is stable: it {_mode(case)} ({_where(case.worst)})."
    if math.isinf(case.worst.rate):
        return f"The scenario's loop has a fault of the law {_where(case.worst)}."
    return f"The scenario's loop is unstable: it {_mode(case)} ({_where(case.worst)})."


def _box(analysis: MarginAnalysis) -> str:
    if len(analysis.cases) == 1:
        return "No model errors were analysed."
    unstable = [case for case in analysis.cases[1:] if not case.is_stable]
    worst = max(analysis.cases[1:], key=lambda case: case.worst.rate)
    if not unstable:
        return (
            f"The loop is stable with all {len(analysis.cases) - 1} model errors; the worst loop "
            f"{_mode(worst)}: {worst.error} ({_where(worst.worst)})."
        )
    return (
        f"{len(unstable)} of {len(analysis.cases) - 1} model errors of the box make the loop "
        f"unstable; the worst loop {_mode(worst)}: {worst.error} ({_where(worst.worst)})."
    )


def _parameters(analysis: MarginAnalysis) -> list[str]:
    ranked = analysis.worst_by_key
    if not ranked:
        return []
    key, case = next(iter(ranked.items()))
    others = ", ".join(
        f"{_PARAMETERS[other]} {_rate(own.worst.rate)}" for other, own in [*ranked.items()][1:]
    )
    beside = f"; others: {others}" if others else ""
    return [
        f"The most critical single error is that in {_PARAMETERS[key]}: {_rate(case.worst.rate)} "
        f"with {case.error} ({_where(case.worst)}){beside}."
    ]


def _drives(analysis: MarginAnalysis) -> list[str]:
    tightest = analysis.tightest
    if tightest is None or not analysis.nominal.is_stable:
        return []
    drive = int(np.argmin([margin.alpha for margin in tightest.drives]))
    margin, what = tightest.drives[drive], "torque"
    if analysis.drives_are_servos:
        what = "velocity command"
    return [
        f"The weakest drive is {analysis.joints[drive]}, {tightest.instant.location}: its {what} "
        f"tolerates a factor of {_gain_and_phase(margin)} (disc margin {margin.alpha:.3g} at "
        f"{margin.frequency / (2.0 * np.pi):.3g} Hz); "
        f"{_delay(analysis.delay)}{'' if analysis.delay > 0 else _WHAT_TO_DO}."
    ]


def _touched(surface: TouchedSurface | None) -> list[str]:
    if surface is None:
        return []
    where = (
        f"The tool presses with {surface.force:.3g} N on a surface of stiffness "
        f"{1e-3 * surface.stiffness:.3g} N/mm ({surface.instant.location})"
    )
    hertz = f"{surface.frequency / (2.0 * np.pi):.2g} Hz"
    if surface.largest_factor == 0.0:
        return [f"{where}, with which the loop is unstable at {hertz}."]
    if math.isinf(surface.largest_factor):
        return [f"{where}; the loop is stable up to the largest analysed factor, {STIFFEST:g}."]
    return [
        f"{where}; the loop is stable up to {surface.largest_factor:.2g} times this stiffness, "
        f"and unstable at {hertz} beyond."
    ]


def _mode(case: Case) -> str:
    point = case.worst
    if point.modes is None:
        return "ends with a fault of the law"
    frequency = point.modes.slowest_frequency / (2.0 * np.pi)
    oscillates = f" at {frequency:.2g} Hz" if frequency > 0.01 else ""
    verb = "decays with" if point.rate <= 0.0 else "grows with"
    return f"{verb} {abs(point.rate):.3g} 1/s{oscillates}"


def _rate(rate: float) -> str:
    return "fault" if math.isinf(rate) else f"{rate:+.3g} 1/s"


def _where(point: OperatingPoint) -> str:
    return point.instant.location


def _gain_and_phase(margin: DiscMargin) -> str:
    low, high = margin.gain
    degrees = math.degrees(margin.phase)
    return f"{100.0 * (low - 1.0):+.3g} to {100.0 * (high - 1.0):+.3g} % or {degrees:.2g} deg"


def _delay(delay: int) -> str:
    if delay <= 0:
        return "no extra delay is tolerated"
    intervals = f"{delay} sampling interval{'s' if delay > 1 else ''}"
    return f"all drives tolerate an extra delay of {intervals}"


def _instant_data(item: Any) -> dict[str, Any]:
    instant = item.instant
    eta = instant.eta[0] if len(instant.eta) == 1 else list(instant.eta)
    return {"t": instant.time, "eta": eta, "speed": instant.speed}


def _case_data(case: Case) -> dict[str, Any]:
    return {
        "model_error": dict(case.error.parts),
        "unknown_mass": case.error.unknown_mass,
        "slowest_rate": case.worst.rate,
        "stable": case.is_stable,
        "places": [
            {
                **_instant_data(point),
                "fault": point.modes is None,
                "rates": [] if point.modes is None else point.modes.rate.tolist(),
                "frequencies_rad_s": [] if point.modes is None else point.modes.frequency.tolist(),
                "smallest_damping": point.damping,
                "neutral_modes": None if point.modes is None else point.modes.neutral,
            }
            for point in case.points
        ],
    }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
