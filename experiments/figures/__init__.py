"""Figures of a run, one file per subject."""
