"""Several signals of a diagram in one log."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    LogVectorOutput,
    Multiplexer,
    VectorLogSink,
    ZeroOrderHold,
)


@dataclass(frozen=True)
class SignalLog:
    """Several signals in one log.

    Attributes:
        signals: All of them together.
        sink: The log.
        rows: Rows of each signal in the log's data.
        delay: By how much later than they were true the sink gets them [s].
    """

    signals: Multiplexer
    sink: VectorLogSink
    rows: dict[str, slice]
    delay: float = 0.0

    def read(self, root: Context) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the times [s], shape (samples,), and the signals, each (samples, size).

        Args:
            root: Context of the diagram.
        """
        log = self.sink.FindLog(root)
        times, data = log.sample_times(), log.data()
        if self.delay:
            times, data = times[1:] - self.delay, data[:, 1:]
        return times, {name: data[rows].T for name, rows in self.rows.items()}

    def now(self, root: Context) -> dict[str, np.ndarray]:
        """Return the signals as they are, logged or not.

        Args:
            root: Context of the diagram.
        """
        row = self.signals.get_output_port().Eval(self.signals.GetMyContextFromRoot(root))
        return {name: row[rows] for name, rows in self.rows.items()}


def add_log(
    builder: DiagramBuilder,
    signals: dict[str, OutputPort],
    period: float,
    *,
    discrete_plant: bool = False,
) -> SignalLog:
    """Log signals at a fixed period; one log costs less time per sample than several.

    What is logged is what whoever is sampled at a tick sees at that tick. A discrete plant with
    sampled ports has made the step that begins with the tick by then; the log publishes before
    that, when the memories of encoders and observers stand for the last tick and the plant does
    not: differences of the two, torques above all, would be those of no instant. So there the
    signals are held by whatever is sampled, and published a tick later.

    Args:
        builder: Builder of the diagram.
        signals: Output ports by signal.
        period: Sampling time of the log [s].
        discrete_plant: Whether the plant is discrete. The log ends a tick earlier then.
    """
    sizes = [port.size() for port in signals.values()]
    multiplexer = builder.AddNamedSystem("log_signals", Multiplexer(sizes))
    for i, port in enumerate(signals.values()):
        builder.Connect(port, multiplexer.get_input_port(i))
    logged = multiplexer.get_output_port()
    if discrete_plant:
        hold = builder.AddNamedSystem("log_hold", ZeroOrderHold(period, logged.size()))
        builder.Connect(logged, hold.get_input_port())
        logged = hold.get_output_port()
    sink = LogVectorOutput(logged, builder, period)
    sink.set_name("log")
    ends = np.cumsum(sizes).tolist()
    rows = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
    delay = period if discrete_plant else 0.0
    return SignalLog(multiplexer, sink, dict(zip(signals, rows, strict=True)), delay)
