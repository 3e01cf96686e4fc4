"""Metrics of what a reference asks of the drives, as the controller believes them."""

import numpy as np

from diagrams.tasks.drive_plan import DrivePlan
from reporting.metrics import Metrics

_BELIEVED = "believed, beforehand"


def plan_metrics(plan: DrivePlan | None) -> Metrics:
    """Return the shares of the drives' limits that a reference takes, and how it was slowed.

    Args:
        plan: Of the reference; None where nobody planned it.
    """
    metrics = Metrics()
    if plan is None or not len(plan.times):
        return metrics
    joints = len(plan.limits) // 2
    shares = {"asked": plan.asked}
    if plan.is_slowed:
        shares["planned"] = plan.demand
        metrics.add("slowest_pace", float(plan.pace.min()), "1", source="of the speed asked for")
        metrics.add("waiting_time", float(plan.waiting_time), "s", source=_BELIEVED)
    for name, demand in shares.items():
        share = np.max(np.abs(demand[:, :joints]) / plan.limits[:joints])
        metrics.add(f"{name}_torque_share", float(share), "1", source=_BELIEVED)
    return metrics
