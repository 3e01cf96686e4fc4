"""Link to a driven robot: response time, missed and saturated samples."""

import numpy as np

from experiments.results.feature import Feature
from experiments.results.run_log import RunLog
from reporting.metrics import Metrics


def link_metrics(log: RunLog) -> Metrics:
    """Return response times and counts of missed and saturated ticks, if there was a link.

    Args:
        log: Log of the run.
    """
    metrics = Metrics()
    if "status_age" not in log:
        return metrics
    ages = log["status_age"].values[:, 0]
    ages = ages[np.isfinite(ages)]
    median, p99 = np.percentile(ages, [50, 99]) if len(ages) else (np.nan, np.nan)
    metrics.add("link_answer_us", float(median))
    metrics.add("link_answer_us_p99", float(p99))
    metrics.add("missed_ticks", int(np.isnan(log["status_age"].values).sum()))
    metrics.add("clipped_ticks", int(np.count_nonzero(log["clipped"].values)))
    if "sent_difference" in log:
        difference = log["sent_difference"]
        largest = float(difference.values.max(initial=0.0))
        metrics.add("largest_sent_difference", largest, difference.unit)
    return metrics


FEATURE = Feature(metrics=lambda log, station, settings: link_metrics(log))
