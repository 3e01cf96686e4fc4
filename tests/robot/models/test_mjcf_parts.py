"""STL meshes, sites, bodies without mass and springs of MJCF models, as MuJoCo has them."""

import struct

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.elastic_joints import ElasticJoints
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

# a tetrahedron; its mass counts where a body has no other
VERTICES = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.12, 0.0], [0.0, 0.0, 0.15]])
TRIANGLES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
MODEL = """<mujoco model="arm">
  <compiler angle="{angle}" meshdir="../assets" {options}/>
  <default>
    <site size="0.01"/>
    <default class="arm"><joint damping="1" armature="0.1"/><site euler="20 -30 50"/></default>
  </default>
  <asset><mesh name="link" file="link.stl"/><mesh file="gone.stl"/></asset>
  <worldbody>
    <body name="pedestal" pos="0.1 -0.2 0.3">
      <body name="base" childclass="arm" quat="1 0.2 0 0">
        <body name="l1" pos="0 0 0.3">
          <inertial mass="4" pos="0 0.02 -0.1" diaginertia="0.1 0.1 0.05"/>
          <joint name="j1" axis="0 0 1"/><geom type="mesh" mesh="gone"/>
          <body name="l2" pos="0.1 0 0.2">
            <joint name="j2" axis="0 1 0"/><geom type="mesh" mesh="link" density="3000"/>
            <site name="tip" pos="0.01 0.02 0.3" {site}/>
            <site name="other" pos="0 0.1 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="j1" ctrlrange="-5 5"/><motor joint="j2" ctrlrange="-5 5"/></actuator>
</mujoco>"""


def write(folder, site="", angle="degree", options="", model=MODEL):
    (folder / "arm").mkdir()
    (folder / "assets").mkdir()
    faces = b"".join(
        struct.pack("<12fH", 0.0, 0.0, 0.0, *VERTICES[list(t)].ravel(), 0) for t in TRIANGLES
    )
    stl = b"\0" * 80 + struct.pack("<I", len(TRIANGLES)) + faces
    (folder / "assets" / "link.stl").write_bytes(stl)
    file = folder / "arm" / "arm.xml"
    file.write_text(model.format(site=site, angle=angle, options=options), encoding="utf-8")
    return file


def read(file, options=None):
    plant = MultibodyPlant(0.0)
    return plant, read_model(plant, file, options)


@pytest.mark.parametrize(
    ("site", "angle", "options"),
    [
        ("", "degree", ""),
        ('quat="1 0.3 -0.2 0.5"', "radian", ""),
        ('axisangle="1 2 -1 70"', "degree", ""),
        ('euler="0.3 0.2 -0.4"', "radian", 'eulerseq="zyx"'),
        ('euler="0.3 0.2 -0.4"', "radian", 'eulerseq="XYZ"'),
        ('xyaxes="1 0.2 0 0.3 1 0.4"', "radian", ""),
        ('zaxis="0.3 -1 0.2"', "radian", ""),
        ('zaxis="0 0 -1"', "radian", ""),
    ],
)
def test_sites_and_masses_are_those_of_mujoco(tmp_path, site, angle, options):
    mujoco = pytest.importorskip("mujoco")
    file = write(tmp_path, site, angle, options)
    plant, warnings = read(file)
    assert len(warnings) == 1 and "torque limits" in warnings[0]
    # MuJoCo itself refuses what is missing
    bare = file.with_name("bare.xml")
    text = file.read_text(encoding="utf-8").replace('<mesh file="gone.stl"/>', "")
    bare.write_text(text.replace('<geom type="mesh" mesh="gone"/>', ""), encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(bare))
    data = mujoco.MjData(model)
    q = np.array([0.4, -0.7])
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    for name in ("tip", "other"):
        pose, own = plant.GetFrameByName(name).CalcPoseInWorld(context), data.site(name)
        np.testing.assert_allclose(pose.translation(), own.xpos, atol=1e-12)
        np.testing.assert_allclose(pose.rotation().matrix().ravel(), own.xmat, atol=1e-9)
    weight = plant.CalcGravityGeneralizedForces(context)
    np.testing.assert_allclose(-weight, data.qfrc_bias, atol=1e-6)
    assert np.abs(weight).max() > 0.1
    # armature is inertia of the drives, which the plant's mass matrix has, too
    inertia = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, inertia)
    np.testing.assert_allclose(plant.CalcMassMatrix(context), inertia, rtol=1e-5)


def test_stl_files_from_elsewhere_are_not_read(tmp_path):
    file = write(tmp_path)
    text = file.read_text(encoding="utf-8").replace("link.stl", "../../link.stl")
    (tmp_path / "assets" / "link.stl").rename(tmp_path.parent / "link.stl")
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="l2"):
        read(file)


ELASTIC = """<mujoco>
  <worldbody>
    <body name="motor" pos="0 0 0.3">
      <inertial mass="5e-4" pos="0 0 0" diaginertia="1e-7 1e-7 1e-7"/>
      <joint name="drive" axis="0 0 1" armature="0.4"/>
      <body name="link">
        <inertial mass="3" pos="0.2 0 0" diaginertia="0.02 0.05 0.05"/>
        <joint {name} axis="0 0 1" stiffness="{stiffness}" damping="2" {ref}/>
        <site name="tip" pos="0.4 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="{driven}" ctrlrange="-50 50"/></actuator>
</mujoco>"""


def elastic(folder, stiffness=700, ref="", driven="drive", name='name="spring"'):
    file = folder / "elastic.xml"
    text = ELASTIC.format(stiffness=stiffness, ref=ref, driven=driven, name=name)
    file.write_text(text, encoding="utf-8")
    return file


def test_a_spring_behind_a_drive_is_an_elastic_joint(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    file = elastic(tmp_path)
    plant, warnings = read(file)
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tip"))
    assert chain.dimension == 1 and not chain.is_rigid
    np.testing.assert_allclose([chain.K_s, chain.K_d], [[700.0], [2.0]])
    assert not [line for line in warnings if "stiffness" in line]
    # the same accelerations
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.gravity[:] = [0.0, 0.0, -9.81]
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = [0.1, 0.03], [0.5, -0.2], [7.0]
    mujoco.mj_forward(model, data)
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, [0.1, 0.03, 0.5, -0.2])
    plant.get_actuation_input_port().FixValue(context, [7.0])
    instance = plant.GetBodyByName("link").model_instance()
    found = plant.get_generalized_acceleration_output_port(instance).Eval(context)
    np.testing.assert_allclose(found, data.qacc, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"driven": "spring"}, "joint 'spring': stiffness = 700 beside an actuator; allowed: 0"),
        ({"name": ""}, "joint without a name: stiffness = 700; allowed: 0, or a joint with a name"),
        ({"ref": 'springref="0.3"'}, "joint 'spring': springref = 0.3; allowed: equal to ref"),
    ],
)
def test_springs_that_would_be_lost_are_refused(tmp_path, given, said):
    with pytest.raises(InputError, match=said):
        read(elastic(tmp_path, **given))


def test_a_rigid_model_becomes_elastic_by_options(tmp_path):
    """Its armature is the rotors' inertia; sites stay on the links."""
    given = ElasticJoints(stiffness=np.array([8000.0, 5000.0]), damping=np.array([5.0, 2.0]))
    plant, _ = read(write(tmp_path), ModelOptions(elastic=given))
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tip"))
    np.testing.assert_allclose(chain.K_s, [8000.0, 5000.0])
    np.testing.assert_allclose(chain.D_M, [0.1, 0.1])
    assert plant.GetFrameByName("tip").body().name() == "l2"
