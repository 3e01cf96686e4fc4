"""Architecture: layers, allowed imports of each package, and the picture of both.

    python -m docs.architecture     # redraws docs/images/architecture.svg

The picture is drawn from the docstrings and imports of the packages; tests check the rules.
"""

import ast
import functools
from collections.abc import Iterator
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "architecture.svg"

# its stub names everything for type checkers; names are loaded on first use
LIBRARY = "pfsc_drake"
# from the top down; a file imports from its own package and from those below, not from one beside
LAYERS = [
    ["experiments"],
    ["identification"],
    ["reporting"],
    ["diagrams"],
    ["diagrams.drawing"],
    ["diagrams.environment"],
    ["diagrams.tasks"],
    ["diagrams.robots"],
    ["diagrams.scenario"],
    ["pfsc_drake.controller", "pfsc_drake.codegen", "pfsc_drake.drivers"],
    ["pfsc_drake.systems"],
    ["pfsc_drake.physics"],
    ["pfsc_drake.control"],
    ["pfsc_drake.robot"],
    ["pfsc_drake.geometry"],
    ["pfsc_drake.blocks"],
    ["pfsc_drake.compiled", "pfsc_drake.yaml"],
    ["pfsc_drake.jets", "pfsc_drake.checks"],
    ["pfsc_drake.errors"],
]
PACKAGES = [package for layer in LAYERS for package in layer]
# packages that a package must not import
UNKNOWN = {
    "pfsc_drake.jets": ["pydrake", "matplotlib"],
    "pfsc_drake.blocks": ["pydrake", "matplotlib"],
    "pfsc_drake.geometry": ["pydrake", "matplotlib"],
    "pfsc_drake.control": ["pydrake", "matplotlib"],
    "pfsc_drake.physics": ["pydrake", "matplotlib"],
    "pfsc_drake": ["matplotlib", "diagrams", "experiments", "identification", "reporting"],
    "reporting": ["pydrake", "diagrams"],
    "diagrams": ["matplotlib", "h5py", "typer", "rich"],
}

_WIDTH, _HEIGHT, _GAP, _MARGIN = 1000, 58, 22, 16
# edges of the boxes; arrows pass layers beside them
_LEFT, _RIGHT = 90, 900
_STYLE = """
text { font: 13px system-ui, sans-serif; fill: #17202e; }
.name { font-weight: 650; }
.what { font-size: 12px; }
.inside { font-size: 11px; fill: #5b6676; }
rect { fill: #ffffff; stroke: #8fa3bb; rx: 6; }
path { fill: none; stroke: #0072b2; stroke-opacity: .45; }
"""


@functools.cache
def imports() -> dict[str, set[str]]:
    """Return the modules that every file imports, by the file's own module."""
    found = {}
    for top in sorted({package.split(".")[0] for package in PACKAGES}):
        for file in sorted((ROOT / top).rglob("*.py")):
            name = ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
            imported: set[str] = set()
            tree = ast.parse(file.read_text(encoding="utf-8"))
            for node in _loaded(tree) if name == LIBRARY else ast.walk(tree):
                if isinstance(node, ast.Import):
                    imported |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    if node.level:
                        raise ValueError(f"{name}: relative import")
                    imported |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
            found[name] = imported
    return found


def _loaded(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes of a module without imports for type checkers."""
    for statement in tree.body:
        if not (isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING"):
            yield from ast.walk(statement)


def is_inside(module: str, package: str) -> bool:
    """Return whether a module is a package or one of its files."""
    return module == package or module.startswith(package + ".")


def package_of(module: str) -> str | None:
    """Return the smallest package that a module is in, if there is one."""
    found = [package for package in PACKAGES if is_inside(module, package)]
    return max(found, key=len, default=None)


def layer_of(package: str) -> int:
    """Return the number of a package's layer, from the top."""
    return next(i for i, layer in enumerate(LAYERS) if package in layer)


def arrows() -> set[tuple[str, str]]:
    """Return pairs of packages of which the first imports from the second."""
    found = set()
    for module, imported in imports().items():
        for other in imported:
            pair = package_of(module), package_of(other)
            if None not in pair and pair[0] != pair[1] and other in imports():
                found.add(pair)
    return found


def draw() -> str:
    """Return the picture as SVG: packages with their purpose, and direct imports."""
    direct = arrows()
    below: dict[str, set[str]] = {}
    for package in reversed(PACKAGES):
        own = {b for a, b in direct if a == package}
        below[package] = own.union(*(below.get(b, set()) for b in own))
    shown = [
        (a, b) for a, b in sorted(direct) if not any(b in below[c] for x, c in direct if x == a)
    ]
    boxes = {}
    for row, layer in enumerate(LAYERS):
        width = (_RIGHT - _LEFT - (len(layer) - 1) * _MARGIN) / len(layer)
        for k, package in enumerate(layer):
            boxes[package] = (
                _LEFT + k * (width + _MARGIN),
                _MARGIN + row * (_HEIGHT + _GAP),
                width,
            )
    height = len(LAYERS) * (_HEIGHT + _GAP) + _MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}">',
        f"<style>{_STYLE}</style>",
        '<marker id="tip" viewBox="0 0 6 6" refX="5" refY="3" markerWidth="6" markerHeight="6" '
        'orient="auto"><path d="M0 0 L6 3 L0 6 z" style="fill:#0072b2"/></marker>',
        f'<rect x="0" y="0" width="{_WIDTH}" height="{height}" style="stroke:none"/>',
    ]
    for package, (x, y, width) in boxes.items():
        lines.append(f'<rect x="{x:.0f}" y="{y}" width="{width:.0f}" height="{_HEIGHT}"/>')
        texts = [("name", package), ("what", _purpose(package)), ("inside", _inside(package))]
        for k, (kind, text) in enumerate(texts):
            lines.append(
                f'<text class="{kind}" x="{x + 10:.0f}" y="{y + 18 + 16 * k}">{escape(text)}</text>'
            )
    lanes = {True: 0, False: 0}
    for a, b in shown:
        if layer_of(b) == layer_of(a) + 1:
            x, _, width = min(boxes[a], boxes[b], key=lambda box: box[2])
            x += width / 2.0
            lines.append(_arrow([(x, boxes[a][1] + _HEIGHT), (x, boxes[b][1])]))
            continue
        # past the layers between, on the side that both boxes touch
        left = any(boxes[package][0] + boxes[package][2] < _RIGHT - 1.0 for package in (a, b))
        lanes[left] += 1
        edges = [
            boxes[package][0] if left else boxes[package][0] + boxes[package][2]
            for package in (a, b)
        ]
        lane = _LEFT - 12 * lanes[left] if left else _RIGHT + 12 * lanes[left]
        begin, end = boxes[a][1] + 0.7 * _HEIGHT, boxes[b][1] + 0.3 * _HEIGHT
        lines.append(_arrow([(edges[0], begin), (lane, begin), (lane, end), (edges[1], end)]))
    return "\n".join([*lines, "</svg>", ""])


def _arrow(corners: list[tuple[float, float]]) -> str:
    line = " L".join(f"{x:.0f} {y:.0f}" for x, y in corners)
    return f'<path d="M{line}" marker-end="url(#tip)"/>'


def _purpose(package: str) -> str:
    """Return the first line of a package's docstring."""
    path = ROOT.joinpath(*package.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    docstring = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return docstring.split("\n")[0]


def _inside(package: str) -> str:
    """Return the folders in a package that are no packages themselves."""
    path = ROOT.joinpath(*package.split("."))
    folders = [p.name for p in sorted(path.glob("*")) if (p / "__init__.py").exists()]
    return " · ".join(name for name in folders if f"{package}.{name}" not in PACKAGES)


def may_import() -> list[tuple[str, str]]:
    """Return each package, and the packages that its files import from, as text."""
    own = arrows()
    return [
        (package, ", ".join(b for b in PACKAGES if (package, b) in own)) for package in PACKAGES
    ]


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")
