"""Identified robots as files for models and scenarios."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagrams.robots.model import locate_model
from identification.consistency.model_edits import edit_model, urdf_text
from identification.consistency.parameter_files import (
    identified_delta,
    identified_robot,
    require_consistent,
)
from identification.model.subject import Subject
from identification.output import make_folder, write_text
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.visuals import Appearance
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.yaml.dumping import dump_typed
from pfsc_drake.yaml.typed import load_file

PARAMETERS_FILE = "parameters.yaml"


@dataclass(frozen=True)
class WrittenModel:
    """Files of an identified robot.

    Attributes:
        parameters: The parameter file, for ``controller.model``, for
            ``controller.friction.nominal.file`` and, for a DELTA robot, for ``robot.model``; None
            for robots from a bare model.
        models: SDF files, one for each variant of the parameter file; for another robot its own
            model file with identified inertias.
        urdf: The robot with rigid joints; None for DELTA robots.
        notes: Parts that could not be written, with the reason, one sentence each.
    """

    parameters: Path | None
    models: Sequence[Path]
    urdf: Path | None
    notes: Sequence[str] = ()

    @property
    def files(self) -> list[Path]:
        """All files."""
        files = (self.parameters, *self.models, self.urdf)
        return list(dict.fromkeys(file for file in files if file is not None))


def write_model(subject: Subject, parameters: np.ndarray, folder: str | Path) -> WrittenModel:
    """Write an identified robot.

    A robot with a parameter file gets a new one, with the same variants as SDF files beside it and
    the robot's appearance, as in ``models/<robot>/``; any other one a URDF alone.

    Args:
        subject: The robot.
        parameters: A consistent set, with or without friction, shape (n,).
        folder: Folder; created if it is missing. Files of the same name are replaced.

    Raises:
        InputError: If the parameters are not consistent or their number is wrong, the robot's file
            cannot represent them, or a file cannot be written.
    """
    parameters = np.asarray(parameters, dtype=float)
    require_consistent(subject, parameters)
    folder = Path(folder)
    make_folder(folder)
    file = folder / PARAMETERS_FILE
    if subject.delta is not None:
        write_text(file, _add_comment(dump_typed(identified_delta(subject, parameters))))
        return WrittenModel(file, [], None)
    if subject.parameters is None:
        return _write_own(subject, parameters, folder)
    robot = identified_robot(subject, parameters)
    urdf = folder / f"{robot.name}.urdf"
    write_text(file, _add_comment(dump_typed(robot)))
    appearance, models = _appearance(subject), []
    for variant in robot.variants:
        models.append(folder / f"{variant.name}.sdf")
        write_text(models[-1], write_sdf(robot, variant, appearance))
    write_text(urdf, urdf_text(subject, parameters))
    return WrittenModel(file, models, urdf)


def _write_own(subject: Subject, parameters: np.ndarray, folder: Path) -> WrittenModel:
    """Write a robot without parameter file."""
    assert subject.block is not None
    own = locate_model(subject.block, subject.folder)
    model, urdf = folder / own.name, folder / f"{own.stem}.urdf"
    if model.resolve() == own.resolve():
        raise InputError(f"{folder}: holds the robot's own model {own.name}; must be another one")
    try:
        text = edit_model(subject, parameters)
    except InputError as error:
        write_text(urdf, urdf_text(subject, parameters))
        return WrittenModel(None, [], urdf, [f"links and joints alone are written: {error}"])
    write_text(model, text)
    if model != urdf:
        write_text(urdf, urdf_text(subject, parameters))
    return WrittenModel(None, [model], urdf)


def _appearance(subject: Subject) -> Appearance:
    """Return the appearance of the robot from the file beside its model, if there is one."""
    assert subject.block is not None
    file = locate_model(subject.block, subject.folder).with_name("appearance.yaml")
    return load_file(Appearance, file) if file.is_file() else Appearance()


def _add_comment(text: str) -> str:
    return f"# Identified parameters of a robot, physically consistent. SI units.\n{text}"
