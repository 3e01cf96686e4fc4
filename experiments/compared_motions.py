"""Whether runs that are put side by side were asked for the same motion."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pfsc_drake.errors import InputError, shortened
from pfsc_drake.yaml.reading import TAG_KEY, parse_yaml, read_text

# keys of a scenario that say where the tool is to be, and when
_MOTION = ("path", "surface", "reference", "duration")
_FILE = "file"
_MOST = 4  # differences that are named


def motion_differences(scenarios: Mapping[str, str]) -> list[str]:
    """Return in what the motions differ that runs were asked for, one phrase each.

    Robots, laws, disturbances and what the tool meets are what one compares; they are no
    differences here.

    Args:
        scenarios: Each run's scenario as resolved, by the run's name. One that is no readable YAML
            tells nothing.
    """
    known = {}
    for name, text in scenarios.items():
        with suppress(InputError):
            if isinstance(data := parse_yaml(text, name), dict):
                known[name] = data
    runs = list(known)
    found = [
        _told(key, dict(zip(runs, values, strict=True)))
        for key, values in _unlike("", [{k: d.get(k) for k in _MOTION} for d in known.values()])
    ]
    if len(found) > _MOST:
        more = len(found) - _MOST
        found[_MOST:] = [f"{more} more key{'s' * (more > 1)}"]
    return found


def _unlike(key: str, values: Sequence[Any]) -> Iterator[tuple[str, Sequence[Any]]]:
    """Yield the keys below a key, and their values, that are not the same in all runs."""
    first = values[0] if values else None
    if all(value == first for value in values):
        return
    if all(isinstance(value, dict) for value in values):
        tags = {str(value.get(TAG_KEY)) for value in values}
        if len(tags) == 1:
            for below in dict.fromkeys(name for value in values for name in value):
                yield from _unlike(f"{key}.{below}".lstrip("."), [v.get(below) for v in values])
            return
    if key.rpartition(".")[2] == _FILE and _same_content(values):
        return
    yield key, values


def _same_content(files: Sequence[Any]) -> bool:
    """Return whether files hold the same; by their names where they are gone."""
    try:
        return len({read_text(Path(str(file))) for file in files}) == 1
    except InputError:
        return len({Path(str(file)).name for file in files}) == 1


def _told(key: str, values: Mapping[str, Any]) -> str:
    """Return what a key is in which runs."""
    runs: dict[str, list[str]] = {}
    for run, value in values.items():
        runs.setdefault(_shown(value), []).append(run)
    if len(runs) == 1:
        return f"{key} is {next(iter(runs))}, but not the same content"
    return f"{key} is " + ", ".join(
        f"{shown} in {' and '.join(own)}" for shown, own in runs.items()
    )


def _shown(value: Any) -> str:
    if value is None:
        return "not given"
    if isinstance(value, dict):
        return str(value.get(TAG_KEY) or Path(str(value.get(_FILE) or "another one")).name)
    if isinstance(value, list) and any(isinstance(entry, dict | list) for entry in value):
        return f"{len(value)} entr{'y' if len(value) == 1 else 'ies'}"
    if isinstance(value, str) and "/" in value:
        return Path(value).name
    return shortened(f"{value:g}" if isinstance(value, float) else str(value))
