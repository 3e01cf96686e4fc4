"""Simulation of a scenario: integration, sensor failures, a wrench on the tool, a person."""

import dataclasses as dc
from typing import Annotated

from pydrake.systems.analysis import GetIntegrationSchemes

from pfsc_drake.checks import require
from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
from pfsc_drake.physics.force_torque_sensor import KINDS
from pfsc_drake.physics.operator_hand import LiveHandParameters
from pfsc_drake.yaml.fields import FILE
from pfsc_drake.yaml.rules import Finite, OneOf, Parameters, Positive, Range

# for an integrator that is chosen before the run
AUTO = "auto"
_SCHEMES = (AUTO, *GetIntegrationSchemes())


@dc.dataclass
class SensorFailureParameters(Parameters):
    """A component of the measured joint state that fails.

    Attributes:
        time: Time of the failure [s]; negative for never.
        component: Index in ``[q_J, v_J, q_M, v_M]``.
        kind: ``nan``: it becomes NaN; ``frozen``: it keeps its last value; ``jump``: it has an
            error of ``size``.
        size: Size of the jump [rad, rad/s, m or m/s].
        whole_joint: Whether all measurements of the component's joint fail, on both sides.
    """

    time: float = -1.0
    component: int = 0
    kind: Annotated[str, OneOf(KINDS)] = "nan"
    size: Finite = 0.0
    whole_joint: bool = False


@dc.dataclass
class SimulationParameters(Parameters):
    """Integration of the plant, frames of the recording, sensor failures.

    Attributes:
        integrator: Drake's name of the integration scheme; ``auto`` for the cheapest one that is
            stable and has an error below 1e-6 (rad, m) over the first tenths of a second, compared
            with a step five times shorter.
        max_step: Largest step [s].
        accuracy: Accuracy of error control, 1e-10 to 0.1; 0 for fixed steps.
        frame_period: Time between the frames of the recording, 1e-3 to 1e3 [s].
        sensor_failure: Failure of a sensor during the run.
        force_sensor_failure: Failure of the force/torque sensor; ``component`` is an index in
            ``[force, torque]``; with ``whole_joint`` all components fail.
        fused: Whether all blocks are evaluated as one function, which is faster; single blocks
            give the same log.
    """

    integrator: Annotated[str, OneOf(_SCHEMES)] = AUTO
    max_step: Annotated[float, Range(1e-06, 0.1, "s")] = 1e-3
    accuracy: Annotated[float, Range(1e-10, 0.1, besides=0.0)] = 0.0
    frame_period: Annotated[float, Range(0.001, 1000.0, "s, a positive number")] = 0.032
    sensor_failure: SensorFailureParameters = dc.field(default_factory=SensorFailureParameters)
    force_sensor_failure: SensorFailureParameters = dc.field(
        default_factory=SensorFailureParameters
    )
    fused: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        # their error control uses stale values after a rejected step
        stale = ("runge_kutta5", "bogacki_shampine3")
        require(
            self.accuracy == 0.0 or self.integrator not in stale,
            "accuracy",
            self.accuracy,
            f"0 (fixed steps) with {' and '.join(stale)}; runge_kutta3 has error control",
        )


@dc.dataclass
class HoldBackParameters(Parameters):
    """A wrench that holds the robot back along its path and has no other effect (Sec. 3.8.4).

    Attributes:
        begin: Begin of the pulse [s].
        end: End of the pulse [s].
        force: Force along the tangent [N], negative against growing ``eta``; 0 for none.
        ramp: Time from zero to full and back [s].
    """

    begin: float = 0.0
    end: float = 1.0
    force: Finite = 0.0
    ramp: Positive = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        long_enough = 2.0 * self.ramp <= (self.end - self.begin) * (1.0 + 1e-9)
        require(long_enough, "end", self.end, "begin + 2 ramp or later")


@dc.dataclass
class OperatorParameters:
    """A person at the controls: a hand on the tool, and settings of the impedance.

    Attributes:
        inputs: CSV file with recorded controls, one line per change, see
            :mod:`diagrams.environment.operator`; a live session leaves it empty. Its column
            ``time`` is in s; ``tick``, of older files, counts sampling intervals.
        hand: The hand.
        tuning: Transition of the impedance to the settings of the person.
    """

    inputs: str = dc.field(default="", metadata=FILE)
    hand: LiveHandParameters = dc.field(default_factory=LiveHandParameters)
    tuning: TuningParameters = dc.field(default_factory=TuningParameters)
