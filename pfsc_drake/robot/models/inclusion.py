"""Which files a robot model includes, found before a reader follows them without end."""

from pathlib import Path
from urllib.parse import unquote

from pydrake.multibody.parsing import PackageMap

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.model_xml import Element, ModelXml, read_model_xml

MOST_INCLUSIONS = 1000


def read_with_inclusions(file: Path, packages: PackageMap) -> list[ModelXml]:
    """Read a model and all that it includes (``<include>`` of SDF and MJCF).

    What cannot be found is left to the parser.

    Args:
        file: The model.
        packages: Where ``package://`` and ``model://`` lead.

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
                    f"{model.place(element)}: includes {target}, which includes itself; "
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
        target = _described(target)
    # what is there but is no regular file is refused when it is read
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


def _described(folder: Path) -> Path | None:
    """Return the model file that a folder's ``model.config`` names last, its newest version."""
    config = folder / "model.config"
    if not config.is_file():
        return None
    versions = list(read_model_xml(config).root.all("sdf"))
    return folder / versions[-1].text.strip() if versions else None
