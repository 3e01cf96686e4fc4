"""Where ``package://`` leads."""

from pathlib import Path

import pytest

from pfsc_drake.robot.models.files import models_directory, packages_for

XML = (
    "<package format='2'><name>{}</name><version>1.0.0</version><description>x</description>"
    "<maintainer email='a@b.c'>a</maintainer><license>BSD</license></package>"
)


@pytest.fixture
def package(tmp_path):
    """Make a folder with a package.xml."""

    def make(folder, name):
        place = tmp_path / folder
        place.mkdir(parents=True, exist_ok=True)
        (place / "package.xml").write_text(XML.format(name), encoding="utf-8")
        return place

    return make


def found(file, content=b"", **folders):
    packages = packages_for(file, content, folders)
    names = set(packages.GetPackageNames())
    return {name: Path(packages.GetPath(name)) for name in names if not name.startswith("drake")}


def test_package_above_the_model(package, tmp_path, write):
    own = package("ws/src/my_robot", "my_robot_description")
    neighbour = tmp_path / "ws/src/other_robot"
    neighbour.mkdir()
    file = write("", "ws/src/my_robot/urdf/deep/arm.urdf")
    everything = found(file, b'<mesh filename="package://other_robot/meshes/a.stl"/>')
    assert everything["my_robot_description"] == own
    assert everything["other_robot"] == neighbour
    assert everything["pfsc_models"] == models_directory()
    assert "other_robot" not in found(file)


def test_the_nearest_package_and_those_given_come_first(package, write):
    package("ws", "arm")
    near, folders = package("ws/arm", "arm"), package("elsewhere", "arm")
    file = write("", "ws/arm/arm.urdf")
    assert found(file)["arm"] == near
    assert found(file, arm=folders)["arm"] == folders


def test_ros_package_path(package, write, monkeypatch):
    place = package("ros/share/tool", "tool")
    file = write("", "mine/arm.urdf")
    assert "tool" not in found(file)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(place.parent))
    assert found(file)["tool"] == place


def test_folders_that_are_none(write, refused, tmp_path):
    file = write("")
    refused(lambda: found(file, arm=tmp_path / "nope"), "packages: arm", "nope", "no such folder")


def test_a_broken_package_xml_is_left_alone(package, write):
    (package("ws", "x") / "package.xml").write_text("no", encoding="utf-8")
    assert "x" not in found(write("", "ws/arm.urdf"))
