"""Results of a run: log, signals, metrics and figures."""
