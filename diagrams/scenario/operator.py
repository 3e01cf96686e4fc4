"""A person who guides the tool while the robot moves, live or as recorded."""

import dataclasses as dc

from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
from pfsc_drake.physics.live_hand import LiveHandParameters
from pfsc_drake.yaml.reading import FILE


@dc.dataclass
class OperatorParameters:
    """A person at the controls: a hand on the tool, and the impedance that yields to it.

    Attributes:
        inputs: CSV file with what was done, one line per change, see
            :mod:`diagrams.surroundings.operator_file`; a live session leaves it empty.
        hand: The hand.
        tuning: How the impedance follows what the person sets.
    """

    inputs: str = dc.field(default="", metadata=FILE)
    hand: LiveHandParameters = dc.field(default_factory=LiveHandParameters)
    tuning: TuningParameters = dc.field(default_factory=TuningParameters)
