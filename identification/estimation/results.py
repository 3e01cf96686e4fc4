"""``identification.h5``: an estimate with all data for its verification.

K instants, N joints, n parameters, n_b base parameters; SI units throughout:

==================== ============== ============================================================
``regressor``        (K, N, n_b)    ``Y_b`` (2.76); times ``projection`` it is Y of all parameters
``torques``          (K, N)         measured ``tau_d``, mean of the periods (2.77)
``weights``          (K, N)         factors of the rows, ``Upsilon^(-1/2)``; 0: not used
``base_parameters``  (n_b,)         the estimate (2.80)
``covariance``       (n_b, n_b)     of the estimate
``standard_deviation`` (n_b,)       of the estimate
``projection``       (n_b, n)       ``K_b``: base parameters of all parameters
``indices``          (n_b,)         parameters whose columns the regressor has
``motion/...``                      ``t, q, v, a`` of the regressor, shapes (K,), (K, N);
                                    ``torque_variance``, ``mean_torque_variance`` (N,)
``repetitions/...``                 ``base_parameters`` (R, n_b), ``covariance`` (R, n_b, n_b)
==================== ============== ============================================================

Attributes contain names and units: ``names`` (in words), ``short_names`` and ``units`` of
``base_parameters``, ``names`` and ``units`` of ``projection`` (of all n parameters), ``labels``
(joints) and ``units`` of signals. The attributes of ``friction`` describe terms beside Coulomb and
viscous friction: ``joints`` (from 1), ``kinds``, ``widths`` (NaN without).
"""

from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np

from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.estimation.identifiability import factorize
from identification.estimation.information import Information, StoredMotion
from identification.estimation.least_squares import Estimate
from identification.estimation.repetitions import Repetitions
from identification.measurement.columns import si_unit
from identification.model.base import BaseParameters
from identification.output import write_bytes
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import read_regular_file
from reporting.hdf5_reading import open_hdf5

FILE_NAME = "identification.h5"
_MOTION = {"q": "q", "v": "v", "a": "a", "torque_variance": "tau", "mean_torque_variance": "tau"}


def save_estimate(path: str | Path, estimate: Estimate, runs: Repetitions | None = None) -> None:
    """Write ``identification.h5``.

    Args:
        path: Path of the file, which is replaced.
        estimate: The estimate.
        runs: Repetitions of the experiment.

    Raises:
        InputError: If the file cannot be written.
    """
    content = BytesIO()  # HDF5 itself does not report a full disk
    with h5py.File(content, "w") as file:
        _write(file, estimate)
        if runs is not None:
            group = file.create_group("repetitions")
            group["base_parameters"] = runs.values
            group["covariance"] = np.array([run.covariance for run in runs.estimates])
    write_bytes(Path(path), content.getvalue())


def load_estimate(path: str | Path) -> Repetitions:
    """Read the estimates of ``identification.h5``; only the first one has its linear system.

    Args:
        path: Path of a file from :func:`save_estimate`.

    Raises:
        InputError: If the file cannot be read or is not such a file.
    """
    read_regular_file(path, "HDF5")
    with open_hdf5(Path(path), FILE_NAME) as content:
        content.check()
        return _read(content.file)


def _write(file: h5py.File, estimate: Estimate) -> None:
    system, base, motion = estimate.system, estimate.base, estimate.motion
    file.attrs["robot"] = estimate.robot
    joints = {"labels": list(estimate.joint_names)}
    torque = [si_unit("tau", unit) for unit in estimate.joint_units]
    squared = [f"({unit})^2" for unit in torque]
    _add(file, "regressor", system.matrix, labels=joints["labels"], names=estimate.short_names)
    _add(file, "torques", system.torques, units=torque, **joints)
    _add(file, "weights", system.weights, units=[f"1/({unit})" for unit in torque], **joints)
    named = {"names": estimate.names, "short_names": estimate.short_names, "units": estimate.units}
    _add(file, "base_parameters", estimate.base_parameters, **named)
    _add(file, "standard_deviation", estimate.standard_deviation, **named)
    _add(file, "covariance", estimate.covariance, **named)
    file["covariance"].attrs["coloured_noise"] = estimate.coloured
    _add(file, "projection", base.projection, names=base.full_names, units=base.full_units)
    _add(file, "indices", base.indices)
    group = file.create_group("motion")
    group.attrs["joint_units"] = list(estimate.joint_units)
    group.attrs["still"] = system.still
    for name, signal in _MOTION.items():
        units = [si_unit(signal, unit) for unit in estimate.joint_units]
        units = squared if signal == "tau" else units
        _add(group, name, np.asarray(getattr(motion, name)), units=units, **joints)
    if motion.t is not None:
        _add(group, "t", np.asarray(motion.t), units=["s"])
    terms = file.create_group("friction").attrs
    terms["joints"] = [term.joint + 1 for term in estimate.friction.terms]
    _set_words(terms, "kinds", [term.kind for term in estimate.friction.terms])
    terms["widths"] = [term.width or np.nan for term in estimate.friction.terms]


def _add(group: h5py.Group, name: str, values: np.ndarray, **words: Sequence[str]) -> None:
    dataset = group.create_dataset(
        name, data=values, compression="gzip", compression_opts=1, shuffle=True
    )
    for key, value in words.items():
        _set_words(dataset.attrs, key, value)


def _set_words(attributes: h5py.AttributeManager, key: str, words: Sequence[str]) -> None:
    attributes.create(key, list(words), shape=(len(words),), dtype=h5py.string_dtype())


def _read(file: h5py.File) -> Repetitions:
    matrix = _numbers(file, "regressor", 3)
    samples, joints, size = matrix.shape
    projection = _numbers(file, "projection", 2)
    base = BaseParameters(
        _numbers(file, "indices", 1, (size,)).astype(int),
        projection,
        _words(file["projection"].attrs["names"], projection.shape[1]),
        _words(file["projection"].attrs["units"], projection.shape[1]),
    )
    if projection.shape[0] != size or not np.all(
        (base.indices >= 0) & (base.indices < projection.shape[1])
    ):
        raise InputError(f"projection of shape {projection.shape}, {size} parameters; must fit")
    signal, group = (samples, joints), file["motion"]
    torques, weights = _numbers(file, "torques", 2, signal), _numbers(file, "weights", 2, signal)
    per_joint = {name: _numbers(group, name, 1, (joints,)) for name in list(_MOTION)[3:]}
    signals = {name: _numbers(group, name, 2, signal) for name in list(_MOTION)[:3]}
    t = _numbers(group, "t", 1, (samples,)) if "t" in group else None
    motion = StoredMotion(**signals, **per_joint, tau=torques, t=t)
    system = Information(
        matrix,
        torques,
        weights > 0.0,
        per_joint["mean_torque_variance"],
        base,
        np.asarray(group.attrs["still"], dtype=bool),
    )
    robot = str(file.attrs["robot"])
    estimate = Estimate(
        robot,
        tuple(_words(file["torques"].attrs["labels"], joints)),
        tuple(_words(group.attrs["joint_units"], joints)),
        base,
        _friction(file["friction"].attrs),
        _numbers(file, "base_parameters", 1, (size,)),
        _numbers(file, "covariance", 2, (size, size)),
        np.asarray(file["covariance"].attrs["coloured_noise"], dtype=bool),
        motion,
        system,
        factorize(*system.weighted(), base.short_names, robot),
    )
    runs = [estimate]
    if "repetitions" in file:
        values = _numbers(file["repetitions"], "base_parameters", 2)
        shape = (len(values), size, size)
        covariances = _numbers(file["repetitions"], "covariance", 3, shape)
        runs += [
            replace(estimate, base_parameters=value, covariance=covariance)
            for value, covariance in zip(values[1:], covariances[1:], strict=True)
        ]
    return Repetitions(tuple(runs))


def _friction(attributes: h5py.AttributeManager) -> FrictionTerms:
    joints, widths = attributes["joints"], attributes["widths"]
    kinds = _words(attributes["kinds"], len(joints))
    return FrictionTerms(
        tuple(
            FrictionTerm(int(joint) - 1, kind, float(width) if np.isfinite(width) else None)
            for joint, kind, width in zip(joints, kinds, widths, strict=True)
        )
    )


def _numbers(
    group: h5py.Group, name: str, dimensions: int, shape: tuple[int, ...] | None = None
) -> np.ndarray:
    values = np.asarray(group[name][()])
    if (
        values.dtype.kind not in "fiu"
        or values.ndim != dimensions
        or shape not in (None, values.shape)
    ):
        raise InputError(
            f"{name}: {values.dtype} of shape {values.shape}; must be numbers of shape "
            f"{shape or f'with {dimensions} dimensions'}"
        )
    if not np.isfinite(values).all():
        raise InputError(f"{name}: not finite throughout; must be")
    return values.astype(float)


def _words(values: Sequence[str], count: int) -> list[str]:
    words = [str(word) for word in values]
    if len(words) != count:
        raise InputError(f"{len(words)} names or units; must be {count}")
    return words
