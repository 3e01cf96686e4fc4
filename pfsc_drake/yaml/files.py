"""Names of files in dataclasses, which are relative to the folder of the file they stand in."""

import dataclasses
from pathlib import Path
from typing import Any

# metadata of text, or of a mapping to text, that names a file, or a folder
FILE = {"file": True}
# the same of text that is a name of something known unless it has a suffix
NAME_OR_FILE = {"file": False}


def resolve_files(value: Any, folder: Path) -> None:
    """Makes the names of files in a dataclass absolute, in place, so that it may stand anywhere.

    Empty names and URIs stay as they are.

    Args:
        value: Dataclass, or a list or mapping with some in it, whose fields are declared with
            FILE and NAME_OR_FILE.
        folder: Where relative names start.
    """
    if isinstance(value, list):
        for item in value:
            resolve_files(item, folder)
    elif isinstance(value, dict):
        for item in value.values():
            resolve_files(item, folder)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            content = getattr(value, field.name)
            if "file" not in field.metadata:
                resolve_files(content, folder)
            elif isinstance(content, dict):
                resolved = {key: _resolved(name, folder) for key, name in content.items()}
                setattr(value, field.name, resolved)
            elif field.metadata["file"] or Path(content).suffix:
                setattr(value, field.name, _resolved(content, folder))


def _resolved(name: str, folder: Path) -> str:
    return str((folder / name).resolve()) if name and "://" not in name else name
