"""A controller in C with all that is needed to try it: replay, real-time loop, Makefile, README."""

import shutil
from pathlib import Path

from pfsc_drake.export.c_controller import CController

_HARNESS = Path(__file__).parent / "harness"
_README = """\
# {title}

Generated C99: no allocation, nothing but the mathematical library, no memory but what is in
`controller_state`.

    controller_state state;
    controller_initialize(&state, &inputs);               /* once, at rest */
    fault = controller_step(&state, &inputs, &outputs);   /* every {period:g} s */

A fault other than 0 holds until the next `controller_initialize`; the outputs then stop the robot.

| input | size | unit |
|---|---|---|
{inputs}

| output | size | unit |
|---|---|---|
{outputs}

The state takes {state} bytes, the source {source} kB.

- `make` builds `replay` and `main_rt`. Other compilers: `-std=c99` or `-ffp-contract=off`.
- `./replay [LOG]` feeds recorded inputs and compares the outputs bit by bit; it prints the time of
  a step. `replay.bin` is there if the export was checked.
- `./main_rt [SECONDS [LOG]]` steps once per sampling time with deadlines and prints a histogram.
  Put your drivers into its two functions `read_inputs` and `write_outputs`.
- `interface.json` says the same as these tables, for programs.
"""


def write_project(controller: CController, folder: Path) -> list[Path]:
    """Write a controller and what goes with it, and return all files.

    Args:
        controller: The controller.
        folder: Made if it does not exist.
    """
    written = controller.write(folder)
    for file in sorted(_HARNESS.iterdir()):
        written.append(Path(shutil.copyfile(file, folder / file.name)))
    source = sum(file.stat().st_size for file in written if file.name.startswith("controller"))
    readme = folder / "README.md"
    said = controller.interface()
    readme.write_text(
        _README.format(
            title=controller.title,
            period=controller.period,
            inputs=_rows(said["inputs"]),
            outputs=_rows(said["outputs"]),
            state=said["state_bytes"],
            source=round(source / 1000),
        ),
        encoding="utf-8",
    )
    return [*written, readme]


def _rows(ports: list[dict[str, object]]) -> str:
    return "\n".join(f"| `{p['name']}` | {p['size']} | {p['unit']} |" for p in ports)
