"""Small robots, written for the tests, in the manner of real ones."""

from pathlib import Path

import pytest
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.reading import ModelOptions, read_model

INERTIAL = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
LIMIT = '<limit lower="-2" upper="2" effort="30" velocity="1.5"/>'


def urdf_link(name, inside=INERTIAL):
    """Return a link."""
    return f'<link name="{name}">{inside}</link>\n'


def urdf_joint(name, parent, child, inside=LIMIT, kind="revolute", axis="0 0 1", xyz="0 0 0.3"):
    """Return a joint."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{inside}</joint>\n'
    )


def urdf(*parts):
    """Return a robot with two joints, floating, without transmissions, and further parts."""
    arm = (
        urdf_link("base_link", "")
        + urdf_link("upper")
        + urdf_link("lower")
        + urdf_link("tcp", "")
        + urdf_joint("shoulder", "base_link", "upper")
        + urdf_joint("elbow", "upper", "lower", axis="0 1 0")
        + urdf_joint("flange", "lower", "tcp", "", "fixed")
    )
    return f'<robot name="arm">\n{arm}{"".join(parts)}</robot>\n'


SDF_INERTIAL = (
    "<inertial><pose>0 0 0.1 0 0 0</pose><mass>2</mass>"
    "<inertia><ixx>0.02</ixx><iyy>0.02</iyy><izz>0.01</izz></inertia></inertial>"
)
SDF_AXIS = (
    "<axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper><effort>30</effort>"
    "<velocity>1.5</velocity></limit>"
    "<dynamics><damping>0.5</damping><spring_stiffness>0</spring_stiffness></dynamics></axis>"
)


def sdf(*parts):
    """Return the like in SDF with one joint, welded to the world."""
    return (
        '<sdf version="1.9"><model name="arm">\n'
        f'<link name="base">{SDF_INERTIAL}</link>\n<link name="arm">{SDF_INERTIAL}</link>\n'
        '<joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>\n'
        '<joint name="shoulder" type="revolute"><parent>base</parent><child>arm</child>'
        f"{SDF_AXIS}</joint>\n{''.join(parts)}</model></sdf>\n"
    )


@pytest.fixture
def write(tmp_path):
    """Write a model into a folder of the user's own and return its path."""

    def to(text, name="arm.urdf") -> Path:
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return file

    return to


@pytest.fixture
def refused():
    """Check that something is refused in one line with these parts."""

    def check(call, *parts):
        with pytest.raises(InputError) as caught:
            call()
        message = str(caught.value)
        assert "\n" not in message
        for part in parts:
            assert str(part) in message, message

    return check


@pytest.fixture
def urdf_parts():
    """Return the functions that write URDF: whole robot, link, joint."""
    return urdf, urdf_link, urdf_joint


@pytest.fixture
def urdf_text():
    """Return the text of a robot with two joints in URDF."""
    return urdf()


@pytest.fixture
def sdf_text():
    """Return the text of a robot with one joint in SDF."""
    return sdf()


@pytest.fixture
def read():
    """Read a model into a plant; return both plant and warnings."""

    def call(file, **options):
        plant = MultibodyPlant(0.0)
        warnings = read_model(plant, file, ModelOptions(**options))
        return plant, warnings

    return call
