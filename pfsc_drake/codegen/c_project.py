"""Any controller of blocks as a C99 project, in one call."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydrake.systems.framework import Diagram

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.codegen.manifest import MANIFEST, refuse_foreign, write_own
from pfsc_drake.errors import require
from pfsc_drake.systems.fuse import fuse


def export(
    controller: Diagram, folder: str | Path, inputs: Mapping[str, np.ndarray] | None = None
) -> CController:
    """Write a controller as C99, with all files needed to test it.

    ::

        follower = add_path_following(builder, plant, "tcp", path, law="elastic")
        export(follower, "controller", {"plant_state": np.tile(follower.start_state, (100, 1))})

    Args:
        controller: Diagram of blocks with an output ``fault`` and the command of the drives as its
            first output, such as a :class:`~pfsc_drake.Follower`.
        folder: Folder of the files, described in its ``README.md``; created if it does not exist.
            Files of earlier exports are replaced, others never: the folder is refused then.
        inputs: Values of all inputs at some ticks, each (ticks, size). They are recorded with the
            controller's outputs, for comparison in C; no record if omitted.

    Returns:
        The controller in C.

    Raises:
        InputError: If a part is not a block, there is no ``fault``, inputs do not fit, or the
            folder contains files of these names that no export has written, or that were changed
            since.
    """
    require(str(folder) != "", "folder", "''", "a folder")
    check_project(Path(folder))
    whole = fuse(controller)
    title = controller.get_name() or "Controller"
    exported = CController.of(whole.network, whole.period, title=title)
    recorded = None if inputs is None else _record(exported, inputs)
    write_project(exported, Path(folder), recorded)
    return exported


def _record(controller: CController, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
    stepper = Stepper(controller.program.network)
    rows = []
    for values in zip(*inputs.values(), strict=True):
        tick = dict(zip(inputs, values, strict=True))
        outputs = stepper.step(**tick)
        network = controller.program.network
        parts = [*(tick[name] for name in network.inputs), *(outputs[n] for n in network.outputs)]
        rows.append(np.concatenate([np.ravel(part) for part in parts]))
    return np.array(rows)


LOG = "replay.bin"
_README_NAME = "README.md"
_HARNESS = Path(__file__).parent / "harness"
_README = """\
# {title}

Generated C99: no allocation, only the mathematical library, and all memory is in
`controller_state`.

    controller_state state;
    controller_initialize(&state, &inputs);               /* once, at rest */
    fault = controller_step(&state, &inputs, &outputs);   /* every {period:g} s */

A fault other than 0 holds until the next `controller_initialize`; the outputs then stop the robot.
With faults above 100 there is no state to stop it from: the drives get 0, and brakes must hold it.

| fault | cause |
|---|---|
{faults}

| input | size | unit |
|---|---|---|
{inputs}

| output | size | unit |
|---|---|---|
{outputs}

The state takes {state} bytes, the tables {tables} bytes, the source {source} kB. Generated from
{origin}.

- `make` builds `replay`, `replay_random` and `main_rt`; so does CMake: `cmake -B build && cmake
  --build build`. Other compilers: `make CC=clang OPTIMIZATION=-O2`, with `-std=c99` or
  `-ffp-contract=off`.
- `./replay [LOG]` feeds the recorded inputs of `replay.bin`, and compares the outputs bit by bit;
  it prints the time of a step. On another machine the sine may differ in the last digit.
- `./replay_random` feeds invalid inputs: they end in a fault, and the command of the drives is
finite.
- `make sanitize` does both with the sanitizers of addresses and undefined behaviour.
- `./main_rt [SECONDS [LOG]]` steps once per sampling time with deadlines and prints a histogram.
  Put your drivers into its two functions `read_inputs` and `write_outputs`.
- `interface.json` contains the same tables, for programs.
"""


def write_project(
    controller: CController, folder: Path, recorded: np.ndarray | None = None
) -> list[Path]:
    """Write a controller and its project, and return all files.

    Args:
        controller: The controller.
        folder: Folder; created if it does not exist.
        recorded: Inputs, then outputs of each tick of a run, in the order of ``interface.json``,
            shape (ticks, inputs and outputs), for ``replay.bin``.

    Raises:
        InputError: If an operation has no translation to C, or the folder is refused.
    """
    files = {name: text.encode("utf-8") for name, text in controller.files().items()}
    files |= {file.name: file.read_bytes() for file in _harness()}
    if recorded is not None:
        files[LOG] = np.ascontiguousarray(recorded, dtype=float).tobytes()
    source = sum(len(text) for name, text in files.items() if name.startswith("controller"))
    interface = controller.interface()
    source_name = f"`{interface['scenario']}`, SHA-256 `{interface['hash']}`"
    files[_README_NAME] = _README.format(
        title=controller.title,
        period=controller.period,
        inputs=_rows(interface["inputs"]),
        outputs=_rows(interface["outputs"]),
        faults="\n".join(f"| {n} | {cause} |" for n, cause in interface["faults"].items()),
        state=interface["state_bytes"],
        tables=interface["table_bytes"],
        origin=source_name if interface["hash"] else "blocks",
        source=round(source / 1000),
    ).encode("utf-8")
    refuse_foreign(folder, (*files, MANIFEST))
    return write_own(folder, files)


def check_project(folder: Path) -> None:
    """Refuse a folder that :func:`write_project` would refuse, before there is a controller.

    Args:
        folder: The folder, which may be missing.

    Raises:
        InputError: If it holds other files of the names of an export, or some that were changed.
    """
    there = [file.name for file in folder.iterdir()] if folder.is_dir() else []
    harness = [file.name for file in _harness()]
    own = [name for name in there if name.startswith("controller") and name[-2:] in (".c", ".h")]
    refuse_foreign(folder, (*own, *harness, "interface.json", LOG, _README_NAME, MANIFEST))


def _harness() -> list[Path]:
    return sorted(file for file in _HARNESS.iterdir() if file.is_file())


def _rows(ports: list[dict[str, object]]) -> str:
    return "\n".join(f"| `{p['name']}` | {p['size']} | {p['unit']} |" for p in ports)
