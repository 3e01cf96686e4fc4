"""What a run gives: log, signals, metrics."""
