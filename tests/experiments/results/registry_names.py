"""What the registry says of the metrics of a log."""

from reporting.registry import find_metric, possible_metrics


def names_about(log, *signals, drives=0, also=()):
    """Return the metrics that the registry expects of a log, of those that need one of these."""
    possible = possible_metrics({*log.signals, *also}, drives)
    return [name for name in possible if set(find_metric(name).needs) & set(signals)]
