"""The layers of the architecture: imports only point downwards."""

import pytest

from docs.architecture import (
    LAYERS,
    PACKAGES,
    PICTURE,
    UNKNOWN,
    arrows,
    draw,
    imports,
    is_inside,
    layer_of,
    package_of,
)

# packages that stand beside each other and do not know each other
STRANGERS = [
    ("diagrams.robots", "diagrams.tasks"),
    ("diagrams.robots", "diagrams.environment"),
    ("diagrams.tasks", "diagrams.environment"),
    ("diagrams.scenario", "diagrams.robots"),
    ("diagrams.scenario", "diagrams.tasks"),
    ("diagrams.scenario", "diagrams.environment"),
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
# what the law knows is any manifold, not a particular one
LAW_KNOWS_NO = [
    "pfsc_drake.control.manifolds.path",
    "pfsc_drake.control.manifolds.moving_point",
    "pfsc_drake.control.manifolds.surface",
    "pfsc_drake.geometry.paths",
    "pfsc_drake.geometry.surfaces",
]


def test_every_file_is_in_a_package():
    # the library's public names, how they are loaded, and the program
    faces = {"pfsc_drake", "pfsc_drake.lazy_names", "pfsc_drake.program"}
    assert [m for m in imports() if package_of(m) is None and m not in faces] == []


def test_imports_point_downwards():
    wrong = [
        f"{module} imports {other}"
        for module, imported in imports().items()
        for other in imported & imports().keys()
        if None not in (package_of(module), package_of(other))
        and package_of(module) != package_of(other)
        and layer_of(package_of(other)) <= layer_of(package_of(module))
    ]
    assert wrong == []


def test_the_picture_is_current():
    """If not: ``make architecture``."""
    drawn = draw()
    assert PICTURE.read_text(encoding="utf-8") == drawn
    assert all(package in drawn for layer in LAYERS for package in layer)
    assert {package for pair in arrows() for package in pair} == set(PACKAGES)


@pytest.mark.parametrize(("package", "other"), STRANGERS)
def test_packages_that_do_not_know_what_is_beside_them(package, other):
    wrong = [
        f"{module} imports {target}"
        for module, imported in imports().items()
        if is_inside(module, package)
        for target in imported
        if is_inside(target, other)
    ]
    assert wrong == []


@pytest.mark.parametrize("package", UNKNOWN)
def test_packages_that_a_package_does_not_know(package):
    wrong = [
        f"{module} imports {target}"
        for module, imported in imports().items()
        if is_inside(module, package)
        for target in imported
        if any(is_inside(target, package) for package in UNKNOWN[package])
    ]
    assert wrong == []


def test_the_law_knows_no_particular_manifold():
    laws = ("pfsc_drake.control.law", "pfsc_drake.control.compliance")
    wrong = [
        f"{module} imports {target}"
        for module, imported in imports().items()
        if any(is_inside(module, package) for package in laws)
        for target in imported
        if any(is_inside(target, known) for known in LAW_KNOWS_NO)
    ]
    assert wrong == []


def test_only_what_builds_a_station_knows_a_scenario():
    """Robots, tasks, environments and warnings are given their own parameters."""
    builders = {
        "diagrams.builder",
        "diagrams.controlled_robot",
        "diagrams.holder_station",
        "diagrams.robot_station",
        "diagrams.scenario_task",
        "diagrams.site",
        "diagrams.station_options",
        "diagrams.station_warnings",
    }
    scenario = {"diagrams.scenario.Scenario", "diagrams.scenario.schema.Scenario"}
    knowing = {
        module
        for module, imported in imports().items()
        if is_inside(module, "diagrams") and imported & scenario
    }
    assert {module for module in knowing if not is_inside(module, "diagrams.scenario")} == builders


def test_no_two_files_import_each_other():
    """Not even by a detour."""
    files = {
        module: {other for other in imported if other in imports() and other != module}
        for module, imported in imports().items()
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
