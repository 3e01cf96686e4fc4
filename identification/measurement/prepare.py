"""From a file to the motion that parameters are estimated from, checked all the way."""

from pathlib import Path

from identification.estimation.wiring import find_mistake
from identification.measurement.columns import Reading
from identification.measurement.files import read_record
from identification.measurement.periods import AveragedMotion, average
from identification.measurement.record import Record
from identification.measurement.synchronization import check_torque_lag
from identification.model.base import BaseParameters, base_parameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError


def read_motion(
    path: str | Path,
    regressor: Regressor,
    period: float | None = None,
    reading: Reading | None = None,
    *,
    skip: int = 1,
    bandwidth_hz: float | None = None,
) -> AveragedMotion:
    """Return what a file holds as one period, averaged and differentiated.

    Args:
        path: Of the file, see :mod:`~identification.measurement.files`.
        regressor: Of the robot whose record it is.
        period: ``T_f`` [s], if the file does not state it.
        reading: What the file says in other words or not at all.
        skip: Periods at the start that are left out.
        bandwidth_hz: ``f_g`` [Hz]; by default ``20 / T_f``.

    Raises:
        InputError: If the file cannot be read or anything is wrong with its signals, see
            :func:`~identification.measurement.files.read_record` and :func:`prepare_motion`.
    """
    record = read_record(path, regressor.subject, period, reading)
    return prepare_motion(record, regressor, skip=skip, bandwidth_hz=bandwidth_hz)


def prepare_motion(
    record: Record,
    regressor: Regressor,
    base: BaseParameters | None = None,
    *,
    skip: int = 1,
    bandwidth_hz: float | None = None,
) -> AveragedMotion:
    """Return one period of a record whose torques belong to its motion.

    Signs, order and units are tried before a delay is named: torques with a wrong sign are best
    explained by a model when they are shifted a little.

    Args:
        record: With its period.
        regressor: Of the robot whose record it is.
        base: Its base parameters, if they are there already.
        skip: Periods at the start that are left out.
        bandwidth_hz: ``f_g`` [Hz]; by default ``20 / T_f``.

    Raises:
        InputError: If the periods cannot be averaged, a signal has the wrong sign, another
            joint's place or another unit, or torques and positions were not sampled at the same
            instants.
    """
    motion = average(record, skip=skip, bandwidth_hz=bandwidth_hz)
    mistake = find_mistake(regressor, base or base_parameters(regressor), motion)
    if mistake is not None:
        raise InputError(f"{record.source}: {mistake.cause}: {mistake.reason}")
    check_torque_lag(motion, regressor.matrix(motion.q, motion.v, motion.a))
    return motion
