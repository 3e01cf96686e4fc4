"""Drives of MJCF models, against what MuJoCo itself makes of them."""

import mujoco
import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.mjcf_drives import mjcf_drives
from pfsc_drake.robot.models.model_xml import read_model_xml
from pfsc_drake.robot.models.reading import read_model

INERTIA = '<inertial pos=".1 0 0" mass="1" diaginertia=".01 .01 .01"/>'
MODEL = """<mujoco model="arm"><compiler angle="radian" autolimits="true"/>
<default><joint armature="0.03"/><general forcerange="-70 70"/>
<default class="big"><joint armature="0.2" frictionloss="3" damping="0.7"/>
<motor ctrlrange="-2 1.5" gear="40"/>
<default class="capped"><joint actuatorfrcrange="-25 25"/></default></default></default>
<worldbody><body name="a" childclass="big">{inertia}<joint name="j1" axis="0 0 1"/>
<body name="b">{inertia}<joint name="j2" class="capped" axis="0 1 0"/>
<body name="c" childclass="main">{inertia}<joint name="j3" axis="0 1 0"/>
<body name="d">{inertia}<joint name="j4" axis="0 0 1" armature="0.5" actuatorfrcrange="-9 9"/>
<body name="e">{inertia}<joint name="j5" axis="0 1 0"/>
<body name="tip">{inertia}<joint name="j6" axis="1 0 0"/>
</body></body></body></body></body></body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""
ACTUATORS = """<motor joint="j1" class="big"/><motor joint="j2" class="big"/>
<position joint="j3" kp="900" kv="30" ctrlrange="-3 3" gear="-2" forcerange="-15 15"/>
<general joint="j4" gainprm="8" ctrlrange="-1 1" ctrllimited="true" forcelimited="true"/>
<motor joint="j5" ctrlrange="-4 4" gear="3" ctrllimited="true"/>
<velocity joint="j5" kv="50" ctrlrange="-5 5" forcerange="-6 6" forcelimited="true"/>
<general joint="j6" gainprm="2000" biastype="affine" biasprm="0 -2000 -10" ctrlrange="-3 3"
 forcelimited="false"/>"""
NAMES = [f"j{i}" for i in range(1, 7)]


def write(folder, actuators=ACTUATORS):
    file = folder / "arm.xml"
    file.write_text(MODEL.format(inertia=INERTIA, actuators=actuators))
    return file


def test_limits_are_those_of_mujoco(tmp_path):
    """The largest force that controls of either sign bring about, the smaller of both sides."""
    file = write(tmp_path)
    drives, model = mjcf_drives([read_model_xml(file)]), mujoco.MjModel.from_xml_path(str(file))
    data, sides = mujoco.MjData(model), []
    for sign in (-1.0, 1.0):
        data.ctrl[:] = 1e6 * sign * np.sign(model.actuator_gear[:, 0])
        mujoco.mj_forward(model, data)
        sides.append(np.abs(data.qfrc_actuator))
    theirs = np.minimum(*sides)
    ours = np.array([drives[name].effort_limit for name in NAMES])
    bounded = np.isfinite(ours)
    assert bounded.tolist() == [True] * 5 + [False]
    np.testing.assert_allclose(ours[bounded], theirs[bounded], rtol=1e-12)
    assert theirs[5] > 5e3
    np.testing.assert_array_equal([drives[name].armature for name in NAMES], model.dof_armature)
    np.testing.assert_array_equal([drives[name].friction for name in NAMES], model.dof_frictionloss)


def test_a_plant_has_the_drives_of_the_model(tmp_path):
    plant, file = MultibodyPlant(0.0), write(tmp_path)
    message = read_model(plant, file)
    theirs = mujoco.MjModel.from_xml_path(str(file))
    for i, name in enumerate(NAMES):
        joint = plant.GetJointByName(name)
        drive = next(a for a in map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
                     if a.joint().name() == name)  # fmt: skip
        assert drive.default_reflected_inertia() == theirs.dof_armature[i]
        assert joint.default_damping() == theirs.dof_damping[i]
        assert not drive.has_controller()
    (limits,) = [line for line in message if "torque limits" in line]
    for words in ("j1 60 (ctrlrange x gear 40)", "j2 25 (actuatorfrcrange)", "j4 8 (ctrlrange)"):
        assert words in limits
    assert "j3 30 (forcerange x gear 2)" in limits and "j6 inf (no limit in the model)" in limits
    assert any("dry friction in the model (j1, j2)" in line for line in message)


def test_joints_without_actuators_are_driven_without_a_limit_and_keep_their_rotors(tmp_path):
    plant = MultibodyPlant(0.0)
    message = read_model(plant, write(tmp_path, actuators=""))
    inertia = [
        plant.get_joint_actuator(i).default_reflected_inertia()
        for i in plant.GetJointActuatorIndices()
    ]
    assert inertia == [0.2, 0.2, 0.03, 0.5, 0.03, 0.03]
    assert any(
        "j1 inf (no limit in the model), j2 25 (actuatorfrcrange)" in line for line in message
    )


def test_what_is_no_number_is_named(tmp_path):
    actuators = '<motor name="m" joint="j1" gear="much"/>'
    with pytest.raises(InputError, match=r"arm.xml:\d+: motor 'm': gear = 'much'; allowed: numb"):
        read_model(MultibodyPlant(0.0), write(tmp_path, actuators=actuators))
