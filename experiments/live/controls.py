"""Sliders, keys and tunable impedance parameters of a live session."""

import math
from dataclasses import asdict, dataclass

from diagrams.scenario import Scenario
from diagrams.station import Station
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.control.compliance.tuned_impedance import AS_GIVEN, KINDS, requests_of
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.space import SpaceManifold

# steps of a slider
_STEPS = 200
# initial stiffness and damping of rigid coordinates when they are made soft: Tab. 4.3
_SOFT = {
    Kind.TANGENTIAL: (500.0, 90.0),
    Kind.TRANSVERSAL: (5000.0, 150.0),
    Kind.ROTATIONAL: (34.4, 24.6),
}
# upper end of a slider relative to the scenario's value
_RANGE = 4.0
_NAMES = {Kind.TANGENTIAL: "along", Kind.TRANSVERSAL: "across", Kind.ROTATIONAL: "turn"}
# descriptions on the page
KIND_WORDS = {Kind.TANGENTIAL: "along", Kind.TRANSVERSAL: "across", Kind.ROTATIONAL: "rotation"}


@dataclass(frozen=True)
class Slider:
    """Slider of a page.

    Attributes:
        name: Its name, by which a page sets it.
        group: Its group: ``keys``, ``hold``, ``switch`` or ``tune``.
        low: Lowest value.
        high: Highest value.
        step: Step between two values.
        value: Initial value.
        keys: Key codes that move it by a step, down and up; empty for none.
        label: Its text on the page; the name if empty.
    """

    name: str
    group: str
    low: float
    high: float
    step: float
    value: float
    keys: tuple[str, str] = ("", "")
    label: str = ""

    def content(self, value: float, *, rigid_top: bool = False) -> dict[str, object]:
        """Return its JSON content.

        Args:
            value: Its current value.
            rigid_top: Whether its highest value means rigid.
        """
        return asdict(self) | {"rigid_top": rigid_top, "value": value}

    def nearest(self, value: float) -> float:
        """Return its admissible value closest to a requested one."""
        inside = min(max(value, self.low), self.high)
        return min(self.low + round((inside - self.low) / self.step) * self.step, self.high)


@dataclass(frozen=True)
class TunedParameter:
    """Tunable stiffness or damping.

    Attributes:
        index: Index among the requests, see :class:`ImpedanceTuner`.
        slider: Its slider.
        top_is_rigid: Whether the highest value means the scenario's rigid value.
        always: Whether the slider's initial value counts, too, instead of the scenario's.
    """

    index: int
    slider: Slider
    top_is_rigid: bool = False
    always: bool = False

    def request(self, value: float) -> float:
        """Return the request for a value of the slider."""
        at_start = abs(value - self.slider.value) < 0.5 * self.slider.step
        if at_start and not self.always:
            return AS_GIVEN
        if self.top_is_rigid and value > self.slider.high - 0.5 * self.slider.step:
            return AS_GIVEN
        return value


def tuned_parameters(settings: Scenario, station: Station) -> list[TunedParameter]:
    """Return the tunable parameters of a station's impedance, those that are constant.

    Args:
        settings: The scenario.
        station: Its station.
    """
    manifold = station.law.linearization.manifold
    kinds = {coordinate.kind for coordinate in manifold.coordinates}
    parameters, impedance = [], settings.compliance.impedance()
    if manifold.name == SpaceManifold.name:
        # guidance has no tangential spring
        return _of_kind(Kind.TANGENTIAL, impedance.tangential, stiffness=False)
    for kind in KINDS:
        # a reference force replaces a stiffness
        pressed = kind is Kind.TRANSVERSAL and settings.compliance.press is not None
        if kind in kinds:
            parameters += _of_kind(kind, impedance.of(kind), stiffness=not pressed)
    return parameters


def _of_kind(kind: Kind, own: CoordinateImpedance, *, stiffness: bool) -> list[TunedParameter]:
    of_stiffness, of_damping = requests_of(kind)
    per = ("Nm/rad", "Nms/rad") if kind is Kind.ROTATIONAL else ("N/m", "Ns/m")
    rigid = not own.stiffness.at and math.isinf(own.stiffness.value)
    soft_stiffness, soft_damping = _SOFT[kind]
    found = []
    if stiffness and not own.stiffness.at:
        value = own.stiffness.value
        high = _round_up(_RANGE * (soft_stiffness if rigid or value == 0.0 else value))
        slider = Slider(
            f"{_NAMES[kind]} k [{per[0]}]",
            "tune",
            0.0,
            high,
            high / _STEPS,
            high if rigid else value,
            label=f"stiffness k, {KIND_WORDS[kind]} [{per[0]}]",
        )
        found.append(TunedParameter(of_stiffness, slider, top_is_rigid=rigid))
    if isinstance(own.damping, Profile) and not own.damping.at:
        value = soft_damping if rigid or own.damping.value == 0.0 else own.damping.value
        high = _round_up(_RANGE * value)
        name, label = _NAMES[kind], f"damping d, {KIND_WORDS[kind]} [{per[1]}]"
        slider = Slider(
            f"{name} d [{per[1]}]", "tune", high / 20.0, high, high / _STEPS, value, label=label
        )
        found.append(TunedParameter(of_damping, slider, always=rigid))
    return found


def _round_up(value: float) -> float:
    """Return the next larger 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(f * decade for f in (1.0, 2.0, 5.0, 10.0) if f * decade >= value * (1.0 - 1e-9))
