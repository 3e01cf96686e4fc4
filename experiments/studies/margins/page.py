"""From a scenario to its margins on one page."""

from dataclasses import dataclass
from pathlib import Path

from diagrams.scenario import Scenario
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import Box
from experiments.studies.margins.picture import draw_margins
from experiments.studies.margins.result import MarginAnalysis
from experiments.studies.margins.words import margins_json, metrics_of, sentences
from pfsc_drake.yaml.typed import dump_typed, load_typed
from reporting.folder import check_folder, open_results
from reporting.page import Report, report_page, write_report
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes


@dataclass(frozen=True)
class MarginsOutcome:
    """What an analysis left.

    Attributes:
        analysis: The analysis.
        report: The page.
    """

    analysis: MarginAnalysis
    report: Report


def write_margins(
    scenario: ScenarioFile, out: Path, box: Box, progress: ProgressListener
) -> MarginsOutcome:
    """Analyse a scenario's margins and write ``margins.json`` and the page.

    Args:
        scenario: The scenario as read.
        out: Folder for the results.
        box: Model errors that are to be borne.
        progress: Told how far it is.

    Raises:
        InputError: If the scenario is wrong or the folder cannot be used.
    """
    inputs = scenario.inputs()
    check_folder(out, "margins", inputs)
    settings = load_typed(Scenario, scenario.data, str(scenario.path))
    with naming(scenario.path):
        analysis = analyse(settings, scenario.path.parent, box, progress)
    with open_results(out, "margins", inputs) as results:
        results.write("margins.json", margins_json(analysis))
        figures = draw_margins(analysis)
        page = report_page(
            kind="Sampled loop",
            title=f"Margins of {scenario.name}",
            description=" ".join(sentences(analysis)),
            scenario_yaml_text=dump_typed(settings),
            metrics=metrics_of(analysis),
            figures=figures,
            log_attributes=standard_attributes(scenario.name),
        )
        return MarginsOutcome(analysis, write_report(results, figures, page))
