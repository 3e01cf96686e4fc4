"""Files of robot models: shipped ones, included files, and packages that they refer to."""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from pydrake.multibody.parsing import PackageMap

from pfsc_drake.errors import InputError, nearest_file, suggestion
from pfsc_drake.robot.models.model_xml import Element, ModelXml, read_model_xml

PACKAGE_NAME = "pfsc_models"
_PACKAGE_URI = f"package://{PACKAGE_NAME}/"


def models_directory() -> Path:
    """Return the directory of the shipped models, which contains the package ``pfsc_models``.

    A wheel has the models inside the package; a clone, and so an editable installation, has
    them next to it.

    Raises:
        InputError: if the models are in neither directory.
    """
    package = Path(__file__).resolve().parents[2]
    for directory in (package / "models", package.parent / "models"):
        if (directory / "package.xml").is_file():
            return directory
    raise InputError(f"robot models of {package.name}: not found in the package nor next to it")


def add_models_to(package_map: PackageMap) -> None:
    """Register ``package://pfsc_models/...`` with a parser, unless it is registered already.

    Args:
        package_map: map of the ``Parser`` that reads the models (``parser.package_map()``).
    """
    if not package_map.Contains(PACKAGE_NAME):
        package_map.Add(PACKAGE_NAME, models_directory())


def resolve_model(name_or_path: str | Path) -> Path:
    """Return the file of a robot model.

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
            allowed = f"{', '.join(shipped)}{suggestion(text, shipped)}"
            raise InputError(f"robot model {text!r}: must be a file or one of {allowed}")
        path = shipped[text]
    try:
        exists = path.exists()
    except OSError:  # an invalid file name
        exists = False
    if not exists:
        raise InputError(f"robot model {text!r}: no such file{nearest_file(path)}")
    return path


MOST_INCLUSIONS = 1000


def read_with_inclusions(file: Path, packages: PackageMap) -> list[ModelXml]:
    """Read a model and all included files (``<include>`` of SDF and MJCF).

    Missing files are left to the parser.

    Args:
        file: The model.
        packages: Folders of ``package://`` and ``model://``.

    Returns:
        The files, each once, the model itself first.

    Raises:
        InputError: If a model includes itself, includes more than ``MOST_INCLUSIONS``, or
            cannot be read.
    """
    files: dict[Path, ModelXml] = {}
    inclusions = 0

    def visit(path: Path, above: tuple[Path, ...]) -> None:
        nonlocal inclusions
        if path not in files:
            files[path] = read_model_xml(path)
        model = files[path]
        for element in model.root.within():
            target = _target(element, path, packages)
            if target is None:
                continue
            inclusions += 1
            if target in (*above, path):
                raise InputError(
                    f"{model.location(element)}: includes {target}, which includes itself; "
                    "allowed: inclusions that end"
                )
            if inclusions > MOST_INCLUSIONS:
                raise InputError(
                    f"{file}: includes more than {MOST_INCLUSIONS} models; allowed: fewer"
                )
            visit(target, (*above, path))

    visit(file.resolve(), ())
    first = files.pop(file.resolve())
    return [ModelXml(file, first.content, first.root), *files.values()]


def _target(element: Element, including: Path, packages: PackageMap) -> Path | None:
    if element.name != "include":
        return None
    uri = element.first("uri")
    address = element.attributes.get("file", "") if uri is None else uri.text.strip()
    target = _local(address, including.parent, packages)
    if target is not None and target.is_dir():
        target = _described_model(target)
    # an existing target that is no regular file is refused when it is read
    return target.resolve() if target is not None and target.exists() else None


def _local(address: str, folder: Path, packages: PackageMap) -> Path | None:
    scheme, separator, rest = address.partition("://")
    if not separator:
        return folder / address if address else None
    if scheme == "file":
        return Path(unquote(rest))
    package, _, inside = rest.partition("/")
    if scheme in ("package", "model") and package in packages.GetPackageNames():
        return Path(packages.GetPath(package)) / inside
    return None


def _described_model(folder: Path) -> Path | None:
    """Return the model file that a folder's ``model.config`` names last, its newest version."""
    config = folder / "model.config"
    if not config.is_file():
        return None
    versions = list(read_model_xml(config).root.all("sdf"))
    return folder / versions[-1].text.strip() if versions else None


_ADDRESS = re.compile(rb"(?:package|model)://([^/\s\"'<>]+)")


def packages_for(file: Path, content: bytes, folders: Mapping[str, Path]) -> PackageMap:
    """Return the packages that a model may refer to.

    In this order: ``folders``; the shipped models; folders above the model with a
    ``package.xml``, and their neighbours of the names that the model refers to;
    ``ROS_PACKAGE_PATH``.

    Args:
        file: The model.
        content: Its bytes.
        folders: Folders by package name.

    Raises:
        InputError: If one of the folders does not exist.
    """
    packages = PackageMap()
    for name, folder in folders.items():
        if not folder.is_dir():
            raise InputError(f"packages: {name}: {folder}: no such folder; allowed: a folder")
        if packages.Contains(name):
            packages.Remove(name)
        packages.Add(name, str(folder))
    add_models_to(packages)
    references = {name.decode("utf-8", "replace") for name in _ADDRESS.findall(content)}
    for folder in file.resolve().parents:
        _add_if_new(packages, folder)
        for name in references - set(packages.GetPackageNames()):
            if name not in (".", "..") and (folder / name).is_dir():
                packages.Add(name, str(folder / name))
    others = PackageMap.MakeEmpty()
    if "ROS_PACKAGE_PATH" in os.environ:
        others.PopulateFromRosPackagePath()
    for name in set(others.GetPackageNames()) - set(packages.GetPackageNames()):
        packages.Add(name, others.GetPath(name))
    return packages


def _add_if_new(packages: PackageMap, folder: Path) -> None:
    """Add a folder under the name in its ``package.xml``, unless that is taken."""
    description = folder / "package.xml"
    if not description.is_file():
        return
    found = PackageMap.MakeEmpty()
    try:
        found.AddPackageXml(str(description))
    except RuntimeError:  # of another kind, or broken: the model need not refer to it
        return
    for name in found.GetPackageNames():
        if not packages.Contains(name):
            packages.Add(name, found.GetPath(name))
