"""CasADi functions as C99 source."""

import re
from collections.abc import Mapping

import casadi as ca
import numpy as np

from pfsc_drake.compiled.c_code import CCode, helpers, table_head, table_text
from pfsc_drake.compiled.code import LiteralTable, Tables
from pfsc_drake.compiled.translation import Translation

__all__ = ["c_source", "parameters"]

_WORDS_OF_C = re.compile(
    r"(auto|bool|break|case|catch|char|class|const|continue|default|delete|do|double|else|enum|"
    r"explicit|export|extern|false|float|for|friend|goto|if|inline|int|long|mutable|namespace|new|"
    r"operator|private|protected|public|register|restrict|return|short|signed|sizeof|static|struct|"
    r"switch|template|this|throw|true|try|typedef|typename|union|unsigned|using|virtual|void|"
    r"volatile|while)"
)
_OPEN = """\
#ifdef __cplusplus
extern "C" {
#endif
"""
_CLOSE = """\
#ifdef __cplusplus
}
#endif
"""


def c_source(functions: Mapping[str, ca.Function], prefix: str) -> dict[str, str]:
    """Return functions as C99, with the same results as CasADi's interpreter to the last bit.

    They are re-entrant, allocate nothing, keep their memory on the stack and need only the
    mathematical library. Arguments and results may overlap only for functions of matrix expressions
    (MX). The compiler must neither fuse multiplication and addition (use ``-std=c99`` or
    ``-ffp-contract=off``) nor use inexact arithmetic.

    Args:
        functions: By their names behind ``prefix_``: identifiers, none of them ``tables``.
        prefix: An identifier.

    Returns:
        Contents of files by their names: ``prefix.h``, ``prefix_name.c`` of each function, and
        the tables, ``prefix_tables.h`` and ``.c``. A function takes a pointer to the nonzeros of
        each argument, then of each result, named as in :func:`parameters`.

    Raises:
        Untranslatable: If a function contains an operation without translation.
    """
    tables = Tables(f"{prefix}_table")
    declarations, files = [], {}
    for name, function in functions.items():
        translation = Translation(CCode, tables)
        inner = translation.function(function)
        names = parameters(function)
        declared = f"void {prefix}_{name}({_declared(function, names)})"
        declarations.append(f"{declared};\n")
        defined = f"{declared}\n{{\n    {inner}({', '.join(names)});\n}}\n"
        text = "\n".join([*translation.texts, defined])
        files[f"{prefix}_{name}.c"] = "\n".join(
            [
                f'#include "{prefix}.h"\n\n#include <math.h>\n#include <stddef.h>\n',
                f'#include "{prefix}_tables.h"\n',
                helpers(text),
                text,
            ]
        )
    named = {
        name: [str(value) for value in LiteralTable(np.frombuffer(content))]
        for content, name in tables.names.items()
    }
    extern = "".join(f"extern {table_head(name, len(named[name]))};\n" for name in named)
    written = [table_text(name, values) for name, values in named.items()]
    return files | {
        f"{prefix}.h": _guarded(f"{prefix}_h", "\n".join([_OPEN, *declarations, _CLOSE])),
        f"{prefix}_tables.h": _guarded(f"{prefix}_tables_h", extern or "/* there are none */\n"),
        f"{prefix}_tables.c": "\n".join(
            [f'#include "{prefix}_tables.h"\n\n#include <math.h>\n', *written]
        ),
    }


def parameters(function: ca.Function) -> list[str]:
    """Return the names of a function's parameters in C: its arguments, then its results.

    Args:
        function: Any function. Characters that C does not allow are replaced; each name is unique.
    """
    names: list[str] = []
    for name in [*function.name_in(), *function.name_out()]:
        name = re.sub(r"\W", "_", name)
        while _WORDS_OF_C.fullmatch(name) or name in names:
            name += "_"
        names.append(name)
    return names


def _guarded(name: str, text: str) -> str:
    guard = name.upper()
    return f"#ifndef {guard}\n#define {guard}\n\n{text}\n#endif\n"


def _declared(function: ca.Function, names: list[str]) -> str:
    sizes = [function.nnz_in(i) for i in range(function.n_in())]
    types = ["const double"] * len(sizes) + ["double"] * function.n_out()
    sizes += [function.nnz_out(i) for i in range(function.n_out())]
    # C has no arrays without elements
    return (
        ", ".join(
            f"{kind} {name}[{size}]" if size else f"{kind} *{name}"
            for kind, name, size in zip(types, names, sizes, strict=True)
        )
        or "void"
    )
