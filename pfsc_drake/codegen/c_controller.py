"""A network of blocks as a controller in C99."""

import enum
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.codegen.manifest import MANIFEST, refuse_foreign, write_own
from pfsc_drake.compiled.c_source import c_source, parameters
from pfsc_drake.compiled.operations import Untranslatable
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError

_FUNCTIONS = "controller_functions"
_DOUBLE = 8  # bytes
# inputs that may be NaN before their first measurement, and stop the motion until then
_UNKNOWN_AT_START = "obstacles"
# units of revolute and prismatic joints; the longer ones first
_UNITS_OF_JOINTS = (
    *(("rad, rad/s", "m, m/s"), ("rad/s", "m/s"), ("rad", "m")),
    *(("Nm s/rad", "N s/m"), ("Nm", "N")),
)
_HEADER = """\
/* {title}

   One call of controller_initialize, then one of controller_step every {period:g} s. Nothing is
   allocated, and all memory is in controller_state: any number of controllers may run.
*/
#ifndef CONTROLLER_H
#define CONTROLLER_H

#ifdef __cplusplus
extern "C" {{
#endif

#define CONTROLLER_SAMPLING_TIME {period!r} /* s */
#define CONTROLLER_DRIVES {drives} /* size of the first output, the command of the drives */

typedef struct {{
    double tick; /* number of the next tick */
    double x[{size}];
    double phase; /* initialized, or a fault that holds until the next initialization */
}} controller_state;

typedef struct {{
{inputs}
}} controller_inputs;

typedef struct {{
{outputs}
}} controller_outputs;

/* Set the initial states from the inputs; if these are invalid, every step is a fault. */
void controller_initialize(controller_state *state, const controller_inputs *inputs);

/* Evaluate one tick; returns the fault, 0 for none. From {first} on there is no state to
   stop from: all outputs but the fault are 0. */
int controller_step(
    controller_state *state, const controller_inputs *inputs, controller_outputs *outputs);

#ifdef __cplusplus
}}
#endif

#endif
"""
_SOURCE = """\
#include "controller.h"

#include <string.h>

#include "{functions}.h"

#define INITIALIZED 4503601774854145.0 /* unlikely in uninitialized memory */
#define LARGEST_START 1e9

static int is_valid(const double *values, size_t size)
{{
    size_t i;
    for (i = 0; i < size; ++i) {{
        if (!(values[i] >= -LARGEST_START && values[i] <= LARGEST_START)) {{
            return 0;
        }}
    }}
    return 1;
}}

static int refuse(controller_state *state, controller_outputs *outputs, int fault)
{{
    memset(outputs, 0, sizeof *outputs);
    outputs->{fault}[0] = fault;{status}
    state->phase = fault;
    return fault;
}}

void controller_initialize(controller_state *state, const controller_inputs *inputs)
{{
    {unused}memset(state, 0, sizeof *state);
    state->phase = {start_invalid};
    if ({is_valid}) {{
        {functions}_initial({initial});
        state->phase = INITIALIZED;
    }}
}}

int controller_step(
    controller_state *state, const controller_inputs *inputs, controller_outputs *outputs)
{{
    double x_next[{size}];
    double fault;
    if (state->phase == {start_invalid} || state->phase == {fault_invalid}) {{
        return refuse(state, outputs, (int)state->phase);
    }}
    if (state->phase != INITIALIZED) {{
        return refuse(state, outputs, {not_initialized});
    }}
    {functions}_step({step});
    memcpy(state->x, x_next, sizeof x_next);
    state->tick += 1.0;
    fault = outputs->{fault}[0];
    if (!(fault >= 0.0 && fault < {not_initialized})) {{
        return refuse(state, outputs, {fault_invalid});
    }}
    return (int)fault;
}}
"""


class CFault(enum.IntEnum):
    """Fault of the calls of a controller in C, beside a :class:`~pfsc_drake.control.law.Fault`."""

    NOT_INITIALIZED = 101
    START_INVALID = 102
    FAULT_INVALID = 103

    @property
    def explanation(self) -> str:
        """Cause of the fault in one phrase."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    CFault.NOT_INITIALIZED: "controller_step was called before controller_initialize",
    CFault.START_INVALID: "controller_initialize was given a value that is NaN, infinite or beyond "
    "1e9",
    CFault.FAULT_INVALID: "the fault output of the controller is not a fault number",
}


def fault_sentences() -> dict[int, str]:
    """Return the sentences of all return values of a controller in C, by value."""
    return {int(fault): fault.explanation for kind in (Fault, CFault) for fault in kind}


@dataclass(frozen=True)
class CController:
    """A controller in C99.

    Attributes:
        program: Program of the network.
        period: Sampling time [s].
        title: Title in the files.
        presets: Initial states by name; the others follow from the inputs.
        scenario: Name of the scenario that it was generated from.
        hash: SHA-256 of the scenario.
        turning: Whether each joint is revolute, otherwise prismatic; ports name both units if it is
            empty or mixed.
    """

    program: Program
    period: float
    title: str = "Controller"
    presets: Mapping[str, np.ndarray] = field(default_factory=dict)
    scenario: str = ""
    hash: str = ""
    turning: tuple[bool, ...] = ()

    @classmethod
    def of(cls, network: Network, period: float, **about: Any) -> "CController":
        """Return a network as a controller.

        Args:
            network: Network of blocks.
            period: Sampling time [s].
            about: Further attributes.

        Raises:
            InputError: If it has no output ``fault``, or no input.
        """
        if "fault" not in network.outputs or not network.inputs:
            raise InputError(
                f"export: outputs {', '.join(network.outputs)} and inputs "
                f"{', '.join(network.inputs)}; there must be fault among the former, and one of "
                "the latter"
            )
        return cls(Program(network), period, **about)

    def files(self) -> dict[str, str]:
        """Return the contents of all source files and of ``interface.json``, by name.

        Raises:
            InputError: If an operation has no translation to C.
        """
        step, initial = self._step, self._initial
        size = max(self.program.size, 1)
        members = {"x": "state->x", "t": "&state->tick", "x_next": "x_next"}
        network = self.program.network
        checked = [
            f"is_valid(inputs->{_identifier(name)}, {network.inputs[name].size})"
            for name in self.program.initial_inputs
            if not name.startswith(_UNKNOWN_AT_START)
        ]
        status = "status" in network.outputs
        return self._functions | {
            "controller.h": _HEADER.format(
                title=self.title,
                period=self.period,
                drives=self.interface()["outputs"][0]["size"],
                first=int(CFault.NOT_INITIALIZED),
                size=size,
                inputs=_members(self.interface()["inputs"]),
                outputs=_members(self.interface()["outputs"]),
            ),
            "controller.c": _SOURCE.format(
                functions=_FUNCTIONS,
                size=size,
                unused="" if checked else "(void)inputs;\n    ",
                is_valid=" && ".join(checked) or "is_valid(&state->tick, 1)",
                initial=", ".join(self._arguments(initial, members | {"x_start": "state->x"})),
                step=", ".join(self._arguments(step, members)),
                fault=_identifier("fault"),
                status=f"\n    outputs->{_identifier('status')}[0] = fault;" if status else "",
                not_initialized=int(CFault.NOT_INITIALIZED),
                start_invalid=int(CFault.START_INVALID),
                fault_invalid=int(CFault.FAULT_INVALID),
            ),
            "interface.json": json.dumps(self.interface(), indent=2) + "\n",
        }

    def write(self, folder: Path) -> list[Path]:
        """Write all files, and return them.

        Args:
            folder: Folder; created if it does not exist.

        Raises:
            InputError: If the folder contains other files of these names, or cannot be written.
        """
        files = {name: text.encode("utf-8") for name, text in self.files().items()}
        refuse_foreign(folder, (*files, MANIFEST))
        return write_own(folder, files)

    def interface(self) -> dict[str, Any]:
        """Return the content of ``interface.json``."""
        network = self.program.network
        inputs = [
            {"name": name, "size": port.size, "unit": self._unit(port.unit)}
            for name, port in network.inputs.items()
        ]
        outputs = [
            {"name": name, "size": network.wires[wire], "unit": self._unit(network.units[name])}
            for name, wire in network.outputs.items()
        ]
        return {
            "inputs": inputs,
            "outputs": outputs,
            "faults": {str(number): text for number, text in fault_sentences().items()},
            "state_bytes": _DOUBLE * (2 + max(self.program.size, 1)),
            "sampling_time": self.period,
            "table_bytes": self.table_bytes,
            "scenario": self.scenario,
            "hash": self.hash,
        }

    def _unit(self, unit: str) -> str:
        """Return a port's unit, reduced if all joints are revolute, or all are prismatic."""
        if not self.turning or any(self.turning) != all(self.turning):
            return unit
        for turns, slides in _UNITS_OF_JOINTS:
            unit = unit.replace(f"{turns} or {slides}", turns if all(self.turning) else slides)
        return unit

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the states set before the start, and their flags: ``x`` and ``preset``."""
        x, preset = np.zeros(self.program.size), np.zeros(len(self.program.states))
        for name, value in self.presets.items():
            x[self.program.states[name]] = value
            preset[list(self.program.states).index(name)] = 1.0
        return x, preset

    @property
    def table_bytes(self) -> int:
        """Size of the tables [bytes]."""
        declared = self._functions[f"{_FUNCTIONS}_tables.h"]
        return sum(_DOUBLE * int(size) for size in re.findall(r"\[(\d+)\];", declared))

    @cached_property
    def _functions(self) -> dict[str, str]:
        try:
            return c_source({"step": self._step, "initial": self._initial}, _FUNCTIONS)
        except Untranslatable as error:
            raise InputError(f"export: {error}, which has no translation to C") from None

    @cached_property
    def _step(self) -> ca.Function:
        return self.program.step()

    @cached_property
    def _initial(self) -> ca.Function:
        """Return ``(t, inputs ..) -> x_start``."""
        names = self.program.initial_inputs
        t = ca.MX.sym("t")
        u = {name: ca.MX.sym(name, self.program.network.inputs[name].size) for name in names}
        x, preset = self.start()
        x_start = self.program.initial(ca.DM(x), ca.DM(preset), t, *u.values())
        return ca.Function("initial", [t, *u.values()], [x_start], ["t", *u], ["x_start"])

    def _arguments(self, function: ca.Function, members: Mapping[str, str]) -> list[str]:
        """Return the arguments of a call of a function in C."""
        n = function.n_in()
        names = [*function.name_in(), *function.name_out()]
        return [
            members.get(name, f"{'inputs' if i < n else 'outputs'}->{member}")
            for i, (name, member) in enumerate(zip(names, map(_identifier, names), strict=True))
        ]


def _identifier(name: str) -> str:
    """Return a name as a C identifier."""
    return parameters(ca.Function("f", [ca.SX.sym("x")], [], [name], []))[0]


def _members(ports: list[dict[str, Any]]) -> str:
    return "\n".join(
        f"    double {_identifier(port['name'])}[{port['size']}];"
        + (f" /* {port['unit']} */" if port["unit"] else "")
        for port in ports
    )
