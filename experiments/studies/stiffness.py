"""Which law when: all laws on joints of rising stiffness, on one page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.scenario_file import ScenarioFile, read_scenario
from experiments.studies.study_page import write_study_page
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import RunRow
from pfsc_drake.robot.models.parameters import load_parameters
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.robot.robot_model import joint_resonances
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import COLOURS, STYLE, WIDTH, Drawing, Figure, render

LAWS = ("elastic", "visco_elastic", "singular_perturbation", "rigid", "velocity_servo")
# of laws that the scenario is not made for: Tab. 4.4, and a loop that is slow against its servos
_GAINS = (
    "controller.gains.visco_elastic={eta: {coefficients: [64000, 4800, 120]}, "
    "xi: {coefficients: [64000, 4800, 120]}}",
    "controller.gains.velocity_servo={eta: {poles: [-10]}, xi: {poles: [-10]}}",
)
# on axis 1 [Nm/rad], the other axes in proportion
STIFFNESS = tuple(10.0 ** np.arange(2.0, 7.01, 0.5))
_SCENARIO = "pfc_elastic_3r"
_MODEL = "comau_racer_1_4_elastic_3r"
# from here on [Nm/rad] the plant's own oscillations need a shorter step of integration [s]
_STIFF, _STIFF_STEP = 3e5, 2e-4
# sampling time of the scenarios [s], and largest K_s epsilon D_b T_s / D_M
_SAMPLING_TIME, _DAMPING_PER_SAMPLE = 1e-3, 0.3
# slower than the scenario, so that the softest joints can follow
_MOTION = ("reference.velocity=0.5", "reference.acceleration=1.0", "reference.points=[0.96, 0.6]")

_DESCRIPTION = (
    "The path of pfc_elastic_3r at 0.5 m/s with joints of rising stiffness, 1 ms control. "
    "The joints have no damping. The elastic law is the best while the joint resonances "
    "stay below about one radian per sampling interval. The visco-elastic law is nearly "
    "as good, on undamped joints too, and stays so above, for it asks of the joint torque "
    "only what it can reach within the sampling interval. The singular perturbation law "
    "needs stiff joints, and K_s epsilon D_b T_s / D_M at most 0.3. The rigid law acts on "
    "the motors and leaves the joints' deflection uncontrolled. The law for velocity "
    "servos needs joints that are fast against it; what remains at high stiffness is the "
    "servos' lag."
)

# of the picture's height, where the crosses of each law are
_CROSSES_TOP, _CROSSES_STEP = 0.985, 0.03


@dataclass
class StudyPoint:
    """One law on joints of one stiffness.

    Attributes:
        law: The law.
        stiffness: Stiffness of axis 1 [Nm/rad].
        resonance: Fastest joint resonance at the start [rad/s].
        deviation: Largest distance from the path after the first rest [m]; NaN after a fault.
        fault: Why the run was stopped, or None.
    """

    law: str
    stiffness: float
    resonance: float
    deviation: float
    fault: str | None


def write_study(
    out: Path,
    progress: Callable[[str], None],
    laws: Sequence[str] = LAWS,
    stiffnesses: Sequence[float] = STIFFNESS,
) -> Report:
    """Run all laws on all stiffnesses, on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Told one line per run, in the order in which they end.
        laws: Laws to compare.
        stiffnesses: Stiffnesses of axis 1 [Nm/rad].

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page (see
            :func:`reporting.folder.open_results`); nothing has been run then.
    """
    with open_results(out, "study") as results:
        points = _run_all(progress, laws, stiffnesses)
        metrics = Metrics()
        for point in points:
            name = f"{point.law}, K_s1 = {point.stiffness:.3g} Nm/rad"
            metrics.add(name, point.deviation, "m", source=point.fault)
        figures = [_picture(points, laws)]
        return write_study_page(
            results,
            title="Which law when",
            description=_DESCRIPTION,
            overrides=_MOTION,
            metrics=metrics,
            figures=figures,
        )


def _run_all(
    progress: Callable[[str], None], laws: Sequence[str], stiffnesses: Sequence[float]
) -> list[StudyPoint]:
    """Run all laws on all stiffnesses, on all cores.

    Raises:
        KeyboardInterrupt: At Ctrl-C.
    """
    cases = [(float(stiffness), law) for stiffness in stiffnesses for law in laws]
    points: dict[tuple[float, str], StudyPoint] = {}
    with TemporaryDirectory() as folder:
        scenarios = {(k, law): _scenario(law, k, Path(folder)) for k, law in cases}
        resonances = {k: _resonance(scenarios[k, laws[0]]) for k in dict(cases)}

        def take(case: tuple[float, str], row: RunRow) -> None:
            stiffness, law = case
            said = row.value("max_path_deviation"), row.reason or None
            point = points[case] = StudyPoint(law, stiffness, resonances[stiffness], *said)
            result = point.fault or f"{point.deviation * 1e3:.3g} mm"
            progress(f"K_s,1 = {stiffness:9.3g} Nm/rad  {law:22s} {result}")

        run_side_by_side(scenarios, take)
    return [points[case] for case in cases]


def _scenario(law: str, stiffness: float, folder: Path) -> ScenarioFile:
    """Return the scenario of one law on one stiffness, with a model file of its own."""
    parameters = load_parameters("comau_racer_1_4")
    variant = next(v for v in parameters.variants if v.name == _MODEL)
    elasticity = parameters.elasticities[variant.elasticity]
    factor = stiffness / elasticity.stiffness[0]
    elasticity.stiffness = elasticity.stiffness * factor
    model = folder / f"arm_{stiffness:.6g}.sdf"
    model.write_text(write_sdf(parameters, variant), encoding="utf-8")
    shipped = read_scenario(_SCENARIO, [*_MOTION, *_GAINS, f"controller.law={law}"])
    data = shipped.data
    data["robot"] = {**data["robot"], "model": str(model)}
    # the same damping ratio of the boundary layer (3.69) at every stiffness, as far as the
    # sampling allows: K_s epsilon D_b / D_M is a rate that must be slow against 1 / T_s
    damping = np.array(data["controller"]["boundary_layer_damping"]) / np.sqrt(factor)
    D_M = parameters.rotors.reflected_inertia[: len(damping)]
    allowed = _DAMPING_PER_SAMPLE * D_M / (elasticity.stiffness * _SAMPLING_TIME)
    data["controller"]["boundary_layer_damping"] = np.minimum(damping, allowed).tolist()
    data["targets"] = {}
    if stiffness > _STIFF:
        data["simulation"] = {**data.get("simulation", {}), "max_step": _STIFF_STEP}
    return ScenarioFile(shipped.path, data)


def _resonance(scenario: ScenarioFile) -> float:
    """Return the fastest joint resonance at the start [rad/s]."""
    settings = load_typed(Scenario, scenario.data, _SCENARIO)
    station = build_station(settings, scenario.path.parent)
    q_J = (station.part.coordinates.link_rows @ station.initial_state)[: station.robot.dimension]
    return float(joint_resonances(station.robot, q_J)[-1])


def _picture(points: Sequence[StudyPoint], laws: Sequence[str]) -> Figure:
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 5.5))
        panel = canvas.subplots()
        for i, (colour, law) in enumerate(zip(COLOURS, laws, strict=False)):
            own = [point for point in points if point.law == law]
            deviations = [point.deviation * 1e3 for point in own]
            panel.plot([p.stiffness for p in own], deviations, "o-", color=colour, label=law)
            failed = [point.stiffness for point in own if point.fault]
            height = [_CROSSES_TOP - _CROSSES_STEP * i] * len(failed)
            across = panel.get_xaxis_transform()
            panel.plot(failed, height, "x", color=colour, markersize=8, transform=across)
        by_stiffness = sorted({(point.stiffness, point.resonance) for point in points})
        for stiffness, resonance in by_stiffness:
            text = f"{resonance / (2 * np.pi):.0f} Hz\n{resonance * 1e-3:.2f} rad"
            panel.annotate(
                text, (stiffness, 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom"
            )
        panel.set(xscale="log", yscale="log")
        panel.set_xlabel("stiffness of axis 1 in Nm/rad, other axes in proportion")
        panel.set_ylabel("largest distance from the path in mm")
        panel.legend()
        caption = (
            "Crosses: stopped by a fault. Above the picture the fastest joint resonance, and the "
            "angle that it turns in one sampling interval of 1 ms."
        )
        return render(Drawing("deviation", "Deviation against stiffness", caption, canvas))
