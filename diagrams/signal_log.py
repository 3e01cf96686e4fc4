"""Several signals of a diagram in one log."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, VectorLogSink


@dataclass(frozen=True)
class SignalLog:
    """Several signals in one log.

    Attributes:
        sink: The log.
        rows: Rows of each signal in the log's data.
    """

    sink: VectorLogSink
    rows: dict[str, slice]

    def read(self, root: Context) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the times [s], shape (samples,), and the signals, each (samples, size).

        Args:
            root: Context of the diagram.
        """
        log = self.sink.FindLog(root)
        data = log.data()
        return log.sample_times(), {name: data[rows].T for name, rows in self.rows.items()}


def add_log(builder: DiagramBuilder, signals: dict[str, OutputPort], period: float) -> SignalLog:
    """Log signals at a fixed period; one log costs less time per sample than several.

    Args:
        builder: Builder of the diagram.
        signals: Output ports by signal.
        period: Sampling time of the log [s].
    """
    sizes = [port.size() for port in signals.values()]
    multiplexer = builder.AddNamedSystem("log_signals", Multiplexer(sizes))
    for i, port in enumerate(signals.values()):
        builder.Connect(port, multiplexer.get_input_port(i))
    sink = LogVectorOutput(multiplexer.get_output_port(), builder, period)
    sink.set_name("log")
    ends = np.cumsum(sizes).tolist()
    rows = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
    return SignalLog(sink, dict(zip(signals, rows, strict=True)))
