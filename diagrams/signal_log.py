"""Several signals of a diagram in one log."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from pfsc_drake.blocks.wiring_blocks import Collect, Hold
from pfsc_drake.controller.fault_description import FaultInstant
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import BlockAccess

_SIGNALS = "log_signals"


@dataclass(frozen=True)
class SignalLog:
    """Several signals in one log.

    Attributes:
        sink: The log.
        rows: Rows of each signal in the log's data.
        delay: Time by which the sink receives the signals late [s].
    """

    sink: VectorLogSink
    rows: dict[str, slice]
    delay: float = 0.0

    def of(self, prefix: str) -> "SignalLog":
        """Return the signals whose names begin with a prefix, by what follows it.

        Args:
            prefix: The prefix.
        """
        chosen = [name for name in self.rows if name.startswith(prefix)]
        rows = {name.removeprefix(prefix): self.rows[name] for name in chosen}
        return SignalLog(self.sink, rows, self.delay)

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

    def now(self, blocks: BlockAccess, root: Context) -> dict[str, np.ndarray]:
        """Return the current values of the signals, logged or not.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        row = blocks.output(root, f"{_SIGNALS}.all")
        return {name: row[rows] for name, rows in self.rows.items()}

    def first_instant(
        self, blocks: BlockAccess, root: Context, signal: str, column: int
    ) -> tuple[FaultInstant, FaultInstant | None]:
        """Return the first instant of a logged fault, and the one before.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram, in which the fault holds.
            signal: Logged signal with the fault.
            column: Column of the fault in the signal.
        """
        times, raw = self.read(root)
        faults = np.flatnonzero(raw[signal][:, column])
        k = int(faults[0]) if len(faults) else len(times)
        instants = [
            FaultInstant(float(times[i]), {name: x[i] for name, x in raw.items()})
            for i in (k - 1, k)
            if 0 <= i < len(times)
        ]
        if k == len(times):
            # it is so new that it has not been logged
            instants.append(FaultInstant(root.get_time(), self.now(blocks, root)))
        return instants[-1], instants[0] if len(instants) > 1 else None


def add_log(
    builder: DiagramBuilder,
    signals: dict[str, OutputPort],
    period: float,
    *,
    discrete_plant: bool = False,
) -> SignalLog:
    """Log signals at a fixed period; one log costs less time per sample than several.

    Logged values are those that a sampled block reads at the tick. A discrete plant with sampled
    ports has then made the step that begins with the tick. The log publishes before that step, when
    the states of encoders and observers belong to the last tick and the state of the plant does
    not: their differences, above all torques, would mix two instants. With such a plant the signals
    are therefore held and published a tick later.

    Args:
        builder: Builder of the diagram.
        signals: Output ports by signal.
        period: Sampling time of the log [s].
        discrete_plant: Whether the plant is discrete. The log ends a tick earlier then.
    """
    collect = Collect({name: port.size() for name, port in signals.items()})
    system = builder.AddNamedSystem(_SIGNALS, BlockSystem(collect, period))
    for name, port in signals.items():
        builder.Connect(port, system.GetInputPort(name))
    logged = system.GetOutputPort("all")
    if discrete_plant:
        hold = builder.AddNamedSystem("log_hold", BlockSystem(Hold(logged.size()), period))
        builder.Connect(logged, hold.GetInputPort("value"))
        logged = hold.GetOutputPort("held")
    sink = LogVectorOutput(logged, builder, period)
    sink.set_name("log")
    return SignalLog(sink, collect.rows, period if discrete_plant else 0.0)
