"""The layers of the architecture: imports only point downwards."""

import ast
import functools
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# from the top down; a file imports from its own layer, and from those further down
LAYERS = [
    ["experiments"],
    ["identification"],
    ["reporting"],
    ["diagrams"],
    ["pfsc_drake.following"],
    ["pfsc_drake.codegen"],
    ["pfsc_drake.systems"],
    ["pfsc_drake.physics"],
    ["pfsc_drake.control"],
    ["pfsc_drake.robot"],
    ["pfsc_drake.geometry"],
    ["pfsc_drake.blocks"],
    ["pfsc_drake.compiled", "pfsc_drake.yaml"],
    ["pfsc_drake.jets"],
    ["pfsc_drake.checks", "pfsc_drake.errors"],
]
# rooms that stand beside each other and do not know each other
STRANGERS = [
    ("diagrams.robots", "diagrams.tasks"),
    ("diagrams.robots", "diagrams.surroundings"),
    ("diagrams.tasks", "diagrams.surroundings"),
    ("diagrams.scenario", "diagrams.robots"),
    ("diagrams.scenario", "diagrams.tasks"),
    ("diagrams.scenario", "diagrams.surroundings"),
    ("pfsc_drake.systems.following_controller", "pfsc_drake.systems.physics"),
    ("pfsc_drake.systems.following_controller", "pfsc_drake.systems.plants"),
    ("pfsc_drake.systems.following_controller", "pfsc_drake.physics"),
    ("pfsc_drake.robot.serial", "pfsc_drake.robot.delta"),
    ("pfsc_drake.geometry.curves", "pfsc_drake.geometry.paths"),
    ("pfsc_drake.geometry.files", "pfsc_drake.geometry.paths"),
    ("pfsc_drake.geometry.files", "pfsc_drake.geometry.surfaces"),
    ("pfsc_drake.geometry.curves", "pfsc_drake.geometry.surfaces"),
    ("pfsc_drake.geometry.surfaces", "pfsc_drake.geometry.paths"),
]
# packages that a room must not know
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
# what the law knows is any manifold, not a particular one
LAW_KNOWS_NO = [
    "pfsc_drake.control.manifolds.path",
    "pfsc_drake.control.manifolds.moving_point",
    "pfsc_drake.control.manifolds.surface",
    "pfsc_drake.geometry.paths",
    "pfsc_drake.geometry.surfaces",
]


@functools.cache
def modules():
    """Return the imported modules of every file, by the file's own module."""
    found = {}
    for top in ("experiments", "identification", "reporting", "diagrams", "pfsc_drake"):
        for file in (ROOT / top).rglob("*.py"):
            name = ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
            imported = set()
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    imported |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    assert node.level == 0, f"{name}: relative import"
                    imported |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
            found[name] = imported
    return found


def inside(module, room):
    return module == room or module.startswith(room + ".")


def height(module):
    """Return the number of the layer that a module is in, from the top, or None."""
    for number, rooms in enumerate(LAYERS):
        if any(inside(module, room) for room in rooms):
            return number
    return None


def test_every_file_is_in_a_layer():
    faces = {"pfsc_drake"}
    assert [m for m in modules() if height(m) is None and m not in faces] == []


def test_imports_point_downwards():
    wrong = [
        f"{module} imports {other}"
        for module, imported in modules().items()
        for other in imported
        if height(module) is not None
        and height(other) is not None
        and height(other) < height(module)
    ]
    assert wrong == []


@pytest.mark.parametrize(("room", "other"), STRANGERS)
def test_rooms_that_do_not_know_what_is_beside_them(room, other):
    wrong = [
        f"{module} imports {target}"
        for module, imported in modules().items()
        if inside(module, room)
        for target in imported
        if inside(target, other)
    ]
    assert wrong == []


@pytest.mark.parametrize("room", UNKNOWN)
def test_packages_that_a_room_does_not_know(room):
    wrong = [
        f"{module} imports {target}"
        for module, imported in modules().items()
        if inside(module, room)
        for target in imported
        if any(inside(target, package) for package in UNKNOWN[room])
    ]
    assert wrong == []


def test_the_law_knows_no_particular_manifold():
    laws = ("pfsc_drake.control.law", "pfsc_drake.control.compliance")
    wrong = [
        f"{module} imports {target}"
        for module, imported in modules().items()
        if any(inside(module, room) for room in laws)
        for target in imported
        if any(inside(target, known) for known in LAW_KNOWS_NO)
    ]
    assert wrong == []


def test_no_two_files_import_each_other():
    """Not even by a detour."""
    files = {
        module: {other for other in imported if other in modules() and other != module}
        for module, imported in modules().items()
    }
    done, path = set(), []

    def visit(module):
        assert module not in path, " -> ".join([*path[path.index(module) :], module])
        if module in done:
            return
        path.append(module)
        for other in sorted(files[module]):
            visit(other)
        path.pop()
        done.add(module)

    for module in sorted(files):
        visit(module)
