"""Where ``package://`` addresses of a user's model lead."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from pydrake.multibody.parsing import PackageMap

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import add_models_to

_ADDRESS = re.compile(rb"(?:package|model)://([^/\s\"'<>]+)")


def packages_for(file: Path, content: bytes, given: Mapping[str, Path]) -> PackageMap:
    """Return the packages that a model may refer to.

    In this order: those given; the shipped models; folders above the model that hold a
    ``package.xml``, and their neighbours of the names that the model refers to;
    ``ROS_PACKAGE_PATH``.

    Args:
        file: The model.
        content: What it holds.
        given: Folders by package name.

    Raises:
        InputError: If a given folder is none.
    """
    packages = PackageMap()
    for name, folder in given.items():
        if not folder.is_dir():
            raise InputError(f"packages: {name}: {folder}: no such folder; allowed: a folder")
        if packages.Contains(name):
            packages.Remove(name)
        packages.Add(name, str(folder))
    add_models_to(packages)
    wanted = {name.decode("utf-8", "replace") for name in _ADDRESS.findall(content)}
    for folder in file.resolve().parents:
        _add_if_new(packages, folder)
        for name in wanted - set(packages.GetPackageNames()):
            if name not in (".", "..") and (folder / name).is_dir():
                packages.Add(name, str(folder / name))
    others = PackageMap.MakeEmpty()
    if "ROS_PACKAGE_PATH" in os.environ:
        others.PopulateFromRosPackagePath()
    for name in set(others.GetPackageNames()) - set(packages.GetPackageNames()):
        packages.Add(name, others.GetPath(name))
    return packages


def _add_if_new(packages: PackageMap, folder: Path) -> None:
    """Add a folder under the name that its ``package.xml`` says, unless that is taken."""
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
