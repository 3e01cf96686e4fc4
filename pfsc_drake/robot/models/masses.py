"""Checks that moving bodies of a plant have mass and inertia."""

from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, WeldJoint

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.inspection import ModelFacts
from pfsc_drake.robot.models.joint_edits import joints_of, moving_joints
from pfsc_drake.robot.models.model_xml import ModelXml

# of a mass matrix scaled to ones on its diagonal; below, accelerations are rounding
_SMALLEST_EIGENVALUE = 1e-12


def require_inertia(plant: MultibodyPlant, model: ModelXml, facts: ModelFacts) -> None:
    """Refuse bodies that move without mass, or with a default mass.

    Args:
        plant: The plant, not finalized.
        model: The model that it was read from.
        facts: Further data of the model.

    Raises:
        InputError: If there is such a link; the line names the first one.
    """
    carriers = {joint.parent_body().index() for joint in moving_joints(plant)}
    for group in _moving_groups(plant):
        mass = sum(body.default_mass() for body in group)
        unsaid = [body.name() for body in group if body.name() in facts.without_inertia]
        # a body between two joints may be massless if the model declares it
        between = not unsaid and any(body.index() in carriers for body in group)
        if mass > 0.0 or between:
            if not (unsaid and model.root.name == "sdf"):
                continue
            hint = "; SDF takes 1 kg for it"
        else:
            hint = ""
        name = (unsaid or [group[0].name()])[0]
        location = facts.without_inertia.get(name, str(model.file))
        raise InputError(
            f"{location}: link '{name}': moves and has no"
            f" {'<inertial>' if unsaid else 'mass'}{hint}; "
            "allowed: <inertial> with a positive mass, or a link fixed to one that has it"
        )


def _moving_groups(plant: MultibodyPlant) -> list[list[RigidBody]]:
    """Return groups of welded bodies, except those welded to the world, base first."""
    world = plant.world_body()
    group = {world.index(): [world]}
    for joint in joints_of(plant):
        child = joint.child_body()
        welded = isinstance(joint, WeldJoint)
        group[child.index()] = group[joint.parent_body().index()] if welded else []
        group[child.index()].append(child)
    groups = {id(bodies): bodies for bodies in group.values() if bodies[0] is not world}
    return list(groups.values())


def require_regular_mass_matrix(plant: MultibodyPlant, file: Path) -> None:
    """Refuse joints that move no inertia.

    Args:
        plant: The plant, finalized.
        file: The model that it was read from.

    Raises:
        InputError: If there is such a joint; the line names it.
    """
    context = plant.CreateDefaultContext()
    if plant.num_velocities() == 0 or plant.num_positions() != plant.num_velocities():
        return
    plant.SetPositions(context, np.random.default_rng(0).uniform(0.1, 0.7, plant.num_positions()))
    mass_matrix = plant.CalcMassMatrix(context)
    scale = np.sqrt(np.maximum(np.diag(mass_matrix), 1e-300))
    eigenvalues, vectors = np.linalg.eigh(mass_matrix / np.outer(scale, scale))
    if eigenvalues[0] < _SMALLEST_EIGENVALUE or not np.isfinite(eigenvalues).all():
        worst = int(np.argmax(np.abs(vectors[:, 0])))
        name = plant.GetVelocityNames(add_model_instance_prefix=False)[worst].rsplit("_", 1)[0]
        raise InputError(
            f"{file}: joint '{name}': moves no inertia (singular mass matrix); allowed: links "
            "with mass, and moments of inertia about their joints"
        )
