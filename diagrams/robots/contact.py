"""A plant whose robot can touch a workpiece."""

from pydrake.geometry import GeometryId, SceneGraph
from pydrake.multibody.plant import (
    ContactModel,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.systems.plants.reactions import ContactWrench


def add_scene(builder: DiagramBuilder, plant: MultibodyPlant) -> SceneGraph:
    """Let what is added to a plant from now on have contact.

    Args:
        builder: Builder of the diagram.
        plant: A discrete plant, not finalized.
    """
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.set_contact_model(ContactModel.kHydroelastic)
    return scene_graph


def connect_scene(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    tool: list[GeometryId],
) -> ContactWrench:
    """Connect a finalized plant with its scene, and return what acts on its tool.

    Args:
        builder: Builder of the diagram, with the plant in it.
        plant: The plant.
        scene_graph: From :func:`add_scene`.
        tool: Contact geometries of the tool.
    """
    builder.Connect(
        plant.get_geometry_pose_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    contact = builder.AddNamedSystem("contact_wrench", ContactWrench(tool))
    builder.Connect(
        plant.get_contact_results_output_port(), contact.GetInputPort("contact_results")
    )
    return contact
