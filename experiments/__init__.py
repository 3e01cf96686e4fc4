"""Experiments: scenario files, runs, logs, metrics, figures and reports."""
