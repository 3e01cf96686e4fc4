"""Paths and surfaces in space: curves, orientations, lengths, frames, curvatures, projections.

Knows neither robots nor Drake. Numbers in parentheses are equations of the dissertation.
"""

from pfsc_drake.lazy_names import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__)
