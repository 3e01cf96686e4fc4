"""Where the shipped robot models are."""

from pathlib import Path

from pydrake.multibody.parsing import PackageMap

from pfsc_drake.errors import InputError

PACKAGE_NAME = "pfsc_models"
_PACKAGE_URI = f"package://{PACKAGE_NAME}/"


def models_directory() -> Path:
    """Returns the directory of the shipped models, which holds the Drake package ``pfsc_models``.

    A wheel carries the models inside the package; a clone, and so an editable installation, has
    them next to it.

    Raises:
        InputError: if the models are in neither place.
    """
    package = Path(__file__).resolve().parents[2]
    for directory in (package / "models", package.parent / "models"):
        if (directory / "package.xml").is_file():
            return directory
    raise InputError(f"robot models of {package.name}: not found in the package nor next to it")


def add_models_to(package_map: PackageMap) -> None:
    """Makes ``package://pfsc_models/...`` known to a parser; does nothing if it is already.

    Args:
        package_map: of the ``Parser`` that is to read the models (``parser.package_map()``).
    """
    if not package_map.Contains(PACKAGE_NAME):
        package_map.Add(PACKAGE_NAME, models_directory())


def resolve_model(name_or_path: str | Path) -> Path:
    """Returns the file of a robot model.

    Args:
        name_or_path: the name of a shipped model (``"comau_racer_1_4_elastic"``), an address
            ``"package://pfsc_models/..."``, or the path of a model file of the user's own.

    Raises:
        InputError: if there is no such file.
    """
    text = str(name_or_path)
    directory = models_directory()
    if text.startswith(_PACKAGE_URI):
        path = directory / text.removeprefix(_PACKAGE_URI)
    elif Path(text).suffix:
        path = Path(text)
    else:
        shipped = {file.stem: file for file in sorted(directory.glob("*/*.sdf"))}
        if text not in shipped:
            raise InputError(f"robot model {text!r}: must be a file or one of {', '.join(shipped)}")
        path = shipped[text]
    try:
        exists = path.exists()
    except OSError:  # a name that no file system takes
        exists = False
    if not exists:
        raise InputError(f"robot model {text!r}: no such file")
    return path
