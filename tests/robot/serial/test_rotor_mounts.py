"""Where a robot's rotors sit, from its parameters (Tab. 2.3)."""

import dataclasses
import re

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory, resolve_model
from pfsc_drake.robot.models.robot_parameters import RotorParameters, load_parameters
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.rotor_coupling import mounts_from_parameters

FILE = models_directory() / "comau_racer_1_4" / "parameters.yaml"
# R_i^{M,j} as printed, rotors 2 to 6
PRINTED = [
    [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
]


def load_chain(model):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(model)))
    plant.Finalize()
    return plant, chain_from_plant(plant, plant.GetFrameByName("tool_point"))[0]


@pytest.fixture(scope="module")
def robot():
    return load_parameters("comau_racer_1_4")


def test_shipped_rotors_are_those_of_the_table(robot):
    assert robot.rotors.fixed_to_link == [1, 1, 3, 3, 4, 5]
    columns = [np.array(R)[:, 2] for R in PRINTED]
    np.testing.assert_array_equal(robot.rotors.spin_axes[1:], columns)
    # rotor 1, assumed: z_0 in frame 1
    table = robot.denavit_hartenberg.table()
    c, s = np.cos(table.alpha[0]), np.sin(table.alpha[0])
    np.testing.assert_allclose(robot.rotors.spin_axes[0], [0.0, s, c], atol=1e-12)


@pytest.mark.parametrize("model", ["comau_racer_1_4_elastic", "comau_racer_1_4_elastic_3r"])
def test_axes_are_fixed_to_drakes_bodies(robot, model):
    """A body's frame is its DH frame; the chain's link frame is the joint's."""
    plant, chain = load_chain(model)
    mounts = mounts_from_parameters(chain, robot)
    assert len(mounts) == chain.dimension
    context = plant.CreateDefaultContext()
    for j, mount in enumerate(mounts):
        assert mount.gear_ratio == robot.rotors.gear_ratio[j]
        assert mount.link == robot.rotors.fixed_to_link[j]
        body = plant.GetBodyByName(f"link_{mount.link}")
        joint = plant.GetJointByName(f"flex_{mount.link}")
        R_LB = plant.CalcRelativeTransform(context, joint.frame_on_child(), body.body_frame())
        in_body = robot.rotors.spin_axes[j]
        np.testing.assert_allclose(mount.axis, R_LB.rotation().matrix() @ in_body, atol=1e-9)


def test_other_robots_are_refused(robot):
    _, chain = load_chain("comau_racer_1_4_elastic")
    without = dataclasses.replace(robot, rotors=dataclasses.replace(robot.rotors))
    without.rotors.fixed_to_link, without.rotors.spin_axes = [], []
    with pytest.raises(InputError, match=r"comau_racer_1_4: no rotors\.fixed_to_link"):
        mounts_from_parameters(chain, without)
    heavier = dataclasses.replace(robot.rotors, inertia=2.0 * robot.rotors.inertia)
    with pytest.raises(InputError, match=r"rotor 1 has D_M = 9\.8982; must be 4\.9491"):
        mounts_from_parameters(chain, dataclasses.replace(robot, rotors=heavier))
    links = list(chain.links)
    links[2] = dataclasses.replace(links[2], axis=np.array([0.0, 1.0, 0.0]))
    turned = dataclasses.replace(chain, links=tuple(links))
    with pytest.raises(InputError, match=r"frame of joint 3 \(motor_3\)"):
        mounts_from_parameters(turned, robot)
    longer = dataclasses.replace(chain, links=(*chain.links, chain.links[0]))
    with pytest.raises(InputError, match="6 joints; must be 7 or more"):
        mounts_from_parameters(longer, robot)


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (r"fixed_to_link: \[1, ", "fixed_to_link: [", "fixed_to_link = .*one per rotor, 6"),
        (r"fixed_to_link: \[1, ", "fixed_to_link: [7, ", r"fixed_to_link = .*0 \(base\) to 6"),
        (r"  spin_axes: .*\n", "", "spin_axes = .*one per rotor, 6"),
        (r"spin_axes: \[\[0, 1", "spin_axes: [[0, 2", r"spin_axes = \[0\.0, 2\.0.*unit vectors"),
        (r"spin_axes: \[\[0, 1", "spin_axes: [[0, .nan", r"spin_axes\[0\]\[1\].*is nan"),
        (r"spin_axes: \[\[0, ", "spin_axes: [[", r"spin_axes = \[1\.0, 0\.0\].*3 numbers each"),
    ],
)
def test_wrong_rotors_name_file_and_key(tmp_path, pattern, replacement, message):
    changed, count = re.subn(pattern, replacement, FILE.read_text(encoding="utf-8"), count=1)
    assert count == 1
    path = tmp_path / "robot.yaml"
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_parameters(path)
    assert re.match(rf"{re.escape(str(path))}(:\d+)?: ", str(caught.value))


def test_rotors_without_mounts_are_allowed():
    assert RotorParameters().fixed_to_link == []
