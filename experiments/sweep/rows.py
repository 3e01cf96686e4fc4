"""What is kept of one run of many."""

import math
from dataclasses import dataclass, field
from typing import Any

from reporting.metrics import Metrics

COMPLETED = "completed"
FAULT = "fault"  # the run was stopped by one
REFUSED = "refused"  # the scenario is wrong
FAILED = "failed"  # an error of the program or of the machine
DIED = "died"  # the process that ran it has ended
STATUSES = (COMPLETED, FAULT, REFUSED, FAILED, DIED)


@dataclass
class RunRow:
    """What is kept of one run.

    Attributes:
        status: One of STATUSES.
        reason: Why it did not complete; empty if it did.
        metrics: Its metrics; none if it never started.
        warnings: What may not have gone as well as hoped, one sentence each.
        end: Simulated time at the end [s].
        seconds: Wall clock time [s].
        host: Machine that ran it.
        revision: Of the program there.
        memory: Of its process after the run [bytes]; not kept in files.
    """

    status: str
    reason: str = ""
    metrics: Metrics = field(default_factory=Metrics)
    warnings: list[str] = field(default_factory=list)
    end: float = math.nan
    seconds: float = math.nan
    host: str = ""
    revision: str = ""
    memory: float = 0.0

    @property
    def is_final(self) -> bool:
        """Whether the same run would end in the same way; not if the machine is to blame."""
        return self.status not in (FAILED, DIED)

    def to_data(self) -> dict[str, Any]:
        """Returns the row as data for JSON; NaN is null."""
        return {
            "status": self.status,
            "reason": self.reason,
            "metrics": self.metrics.to_data(),
            "warnings": self.warnings,
            "end": _or_null(self.end),
            "seconds": _or_null(self.seconds),
            "host": self.host,
            "revision": self.revision,
        }

    @classmethod
    def from_data(cls, data: dict[str, Any]) -> "RunRow":
        """Returns the row of what :meth:`to_data` gave.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: If it is something else.
        """
        if data["status"] not in STATUSES:
            raise ValueError(data["status"])
        return cls(
            data["status"],
            str(data["reason"]),
            Metrics.from_data(data["metrics"]),
            [str(warning) for warning in data["warnings"]],
            _or_nan(data["end"]),
            _or_nan(data["seconds"]),
            str(data["host"]),
            str(data["revision"]),
        )


def _or_null(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
