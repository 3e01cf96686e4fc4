"""The margins of a loop for scripts and notebooks."""

from dataclasses import dataclass
from html import escape

from experiments.studies.margins.page import draw_margins
from experiments.studies.margins.result import MarginAnalysis
from experiments.studies.margins.words import metrics_of, sentences
from reporting.metrics import Metrics
from reporting.notebook import metrics_table
from reporting.style import Figure


@dataclass(frozen=True)
class Margins:
    """What a sampled loop bears, in words, numbers and pictures.

    Attributes:
        name: Name of the scenario.
        analysis: All that is known of the loop: its modes along the way, with each model error.
    """

    name: str
    analysis: MarginAnalysis

    @property
    def is_stable(self) -> bool:
        """Whether the loop is stable everywhere with a perfect model."""
        return self.analysis.nominal.is_stable

    @property
    def is_robust(self) -> bool:
        """Whether it is stable with all model errors that were asked for, too."""
        return all(case.is_stable for case in self.analysis.cases)

    @property
    def sentences(self) -> list[str]:
        """What a person should know, the most important first."""
        return sentences(self.analysis)

    @property
    def metrics(self) -> Metrics:
        """The same in numbers, by name."""
        return metrics_of(self.analysis)

    @property
    def figures(self) -> dict[str, Figure]:
        """Pictures by name, each with ``png`` and ``caption``; a notebook shows them."""
        return {figure.name: figure for figure in draw_margins(self.analysis)}

    def _repr_html_(self) -> str:
        """Return words and numbers."""
        said = "".join(f"<li>{escape(sentence)}</li>" for sentence in self.sentences)
        return f"<b>Margins of {escape(self.name)}</b><ul>{said}</ul>{metrics_table(self.metrics)}"
