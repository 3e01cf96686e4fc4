"""Report page of a study."""

from collections.abc import Sequence

from reporting.folder import ResultsFolder
from reporting.metrics import Metrics
from reporting.page import Page, Report
from reporting.provenance import standard_attributes
from reporting.style import Figure


def write_study_page(
    results: ResultsFolder,
    *,
    title: str,
    description: str,
    overrides: Sequence[str],
    metrics: Metrics,
    figures: Sequence[Figure],
) -> Report:
    """Write metrics and page of a study, and return the page.

    Args:
        results: Folder of the results.
        title: Title of the page.
        description: Description of runs and results.
        overrides: Changes of scenarios, one line each.
        metrics: Results of all runs.
        figures: Figures.
    """
    results.write("metrics.json", metrics.to_json())
    return Page(
        kind="Study",
        title=title,
        description=description,
        scenario_yaml_text="\n".join(overrides),
        metrics=metrics,
        figures=figures,
        log_attributes=standard_attributes(title),
    ).write(results)
