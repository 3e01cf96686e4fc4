"""The SDF text that is written from parameters and appearance."""

import shutil
from dataclasses import replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import JointIndex
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.robot.models import writer
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.models.robot_parameters import VariantParameters, load_parameters
from pfsc_drake.robot.models.visuals import Appearance
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.yaml.typed import load_file

COMAU = load_parameters("comau_racer_1_4")
DIRECTORY = models_directory() / "comau_racer_1_4"
APPEARANCE = load_file(Appearance, DIRECTORY / "appearance.yaml")
TABLE = COMAU.denavit_hartenberg.table()
VARIANTS = {variant.name: variant for variant in COMAU.variants}


def test_shipped_files_are_what_the_writer_gives(tmp_path, monkeypatch):
    shipped = models_directory()
    models = shutil.copytree(shipped, tmp_path / "models", ignore=shutil.ignore_patterns("*.sdf"))
    monkeypatch.setattr(writer, "models_directory", lambda: models)
    writer.main()
    # what has parameters is made of them; other models are what they are
    result = [file.parent for file in shipped.glob("*/parameters.yaml")]
    files = {file.relative_to(shipped) for folder in result for file in folder.glob("*.sdf")}
    assert {file.relative_to(models) for file in models.glob("*/*.sdf")} == files
    for file in files:
        message = f"{file} is not up to date: run python -m pfsc_drake.robot.models.writer"
        text = (models / file).read_text(encoding="utf-8")
        assert (shipped / file).read_text(encoding="utf-8") == text, message


def test_no_collision_geometry_unless_requested():
    variant = VARIANTS["comau_racer_1_4_elastic"]
    assert "<collision" not in write_sdf(COMAU, variant, APPEARANCE)
    text = write_sdf(COMAU, variant, APPEARANCE, collisions=True)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(time_step=1e-3), builder)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    assert plant.num_collision_geometries() > 40
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    assert not query.ComputePointPairPenetration()


def test_bare_model_without_appearance():
    plant = MultibodyPlant(0.0)
    bare = VariantParameters(name="bare", fixed_deg=np.array([0.0, 10.0]))
    Parser(plant).AddModelsFromString(write_sdf(COMAU, bare), "sdf")
    plant.Finalize()
    names = [plant.get_joint(JointIndex(i)).name() for i in range(plant.num_joints())]
    assert names == [
        "weld_base",
        *[f"joint_{i}" for i in range(1, 5)],
        "weld_5",
        "weld_6",
        "weld_tool",
    ]
    q = np.array([0.1, 0.2, 0.3, 0.4])
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X_WT = plant.GetFrameByName("tool_point").CalcPoseInWorld(context)
    y_t, R_e = TABLE.pose([*q, 0.0, np.deg2rad(10.0)], COMAU.tool.tool_point)
    assert X_WT.IsNearlyEqualTo(RigidTransform(RotationMatrix(R_e), y_t), 1e-12)


def test_rotor_bodies_may_be_without_mass():
    """Elastic joints between massless rotor bodies still make a valid model: D_M is reflected."""
    variant = VARIANTS["comau_racer_1_4_elastic_3r"]
    rotors = replace(COMAU.rotors, body_mass=0.0)
    plant = MultibodyPlant(0.0)
    text = write_sdf(replace(COMAU, rotors=rotors), variant, APPEARANCE)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    mass = plant.CalcMassMatrix(plant.CreateDefaultContext())
    assert plant.GetBodyByName("rotor_1").default_mass() == 0.0
    assert np.linalg.eigvalsh(mass)[0] > 0.0
