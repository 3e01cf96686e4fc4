"""What a person can set and press, and what it means: sliders, keys and a gamepad."""

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
# where the stiffness and damping of what is rigid begin when it is made soft: Tab. 4.3
_SOFT = {
    Kind.TANGENTIAL: (500.0, 90.0),
    Kind.TRANSVERSAL: (5000.0, 150.0),
    Kind.ROTATIONAL: (34.4, 24.6),
}
# over what is given, of the end of a slider
_RANGE = 4.0
_WORDS = {Kind.TANGENTIAL: "along", Kind.TRANSVERSAL: "across", Kind.ROTATIONAL: "turn"}


@dataclass(frozen=True)
class Slider:
    """A slider.

    Attributes:
        name: Its label.
        group: What it belongs to: ``keys``, ``hold``, ``switch`` or ``tune``.
        low: Lowest value.
        high: Highest value.
        step: Between two values.
        value: Where it starts.
        keys: Key codes that move it by a step, down and up; empty for none.
    """

    name: str
    group: str
    low: float
    high: float
    step: float
    value: float
    keys: tuple[str, str] = ("", "")

    def content(self, value: float, *, rigid_top: bool = False) -> dict[str, object]:
        """Return it for JSON.

        Args:
            value: Where it is now.
            rigid_top: Whether its highest value stands for what is rigid.
        """
        return asdict(self) | {"rigid_top": rigid_top, "value": value}

    def nearest(self, value: float) -> float:
        """Return the value that it can have next to one that is asked for."""
        inside = min(max(value, self.low), self.high)
        return min(self.low + round((inside - self.low) / self.step) * self.step, self.high)


@dataclass(frozen=True)
class TunedParameter:
    """A stiffness or damping that can be changed.

    Attributes:
        index: Among the requests, see :class:`ImpedanceTuner`.
        slider: By which.
        top_is_rigid: Whether the highest value stands for what is given, which is rigid.
        always: Whether the slider counts where it starts, too, and not what is given.
    """

    index: int
    slider: Slider
    top_is_rigid: bool = False
    always: bool = False

    def request(self, value: float) -> float:
        """Return what a value of the slider asks for."""
        at_start = abs(value - self.slider.value) < 0.5 * self.slider.step
        if at_start and not self.always:
            return AS_GIVEN
        if self.top_is_rigid and value > self.slider.high - 0.5 * self.slider.step:
            return AS_GIVEN
        return value


def tuned_parameters(settings: Scenario, station: Station) -> list[TunedParameter]:
    """Return what of a station's impedance can be changed, as far as it is constant.

    Args:
        settings: The scenario.
        station: Its station.
    """
    manifold = station.law.linearization.manifold
    kinds = {coordinate.kind for coordinate in manifold.coordinates}
    parameters, given = [], settings.compliance.impedance()
    if manifold.name == SpaceManifold.name:
        # guidance leads along, without a spring
        return _of_kind(Kind.TANGENTIAL, given.tangential, stiffness=False)
    for kind in KINDS:
        # a force that is to be pressed with takes the place of a stiffness
        pressed = kind is Kind.TRANSVERSAL and settings.compliance.press is not None
        if kind in kinds:
            parameters += _of_kind(kind, given.of(kind), stiffness=not pressed)
    return parameters


def _of_kind(kind: Kind, given: CoordinateImpedance, *, stiffness: bool) -> list[TunedParameter]:
    of_stiffness, of_damping = requests_of(kind)
    per = ("Nm/rad", "Nms/rad") if kind is Kind.ROTATIONAL else ("N/m", "Ns/m")
    rigid = not given.stiffness.at and math.isinf(given.stiffness.value)
    soft_stiffness, soft_damping = _SOFT[kind]
    found = []
    if stiffness and not given.stiffness.at:
        value = given.stiffness.value
        high = _round_up(_RANGE * (soft_stiffness if rigid or value == 0.0 else value))
        slider = Slider(
            f"{_WORDS[kind]} k [{per[0]}]",
            "tune",
            0.0,
            high,
            high / _STEPS,
            high if rigid else value,
        )
        found.append(TunedParameter(of_stiffness, slider, top_is_rigid=rigid))
    if isinstance(given.damping, Profile) and not given.damping.at:
        value = soft_damping if rigid or given.damping.value == 0.0 else given.damping.value
        high = _round_up(_RANGE * value)
        name = f"{_WORDS[kind]} d [{per[1]}]"
        slider = Slider(name, "tune", high / 20.0, high, high / _STEPS, value)
        found.append(TunedParameter(of_damping, slider, always=rigid))
    return found


def _round_up(value: float) -> float:
    """Return the next number that begins with 1, 2 or 5 and has only zeros behind."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(f * decade for f in (1.0, 2.0, 5.0, 10.0) if f * decade >= value * (1.0 - 1e-9))
