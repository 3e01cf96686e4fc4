"""Actuators for a model that has none, in a plant of the user's own."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, JointActuator

from pfsc_drake.errors import InputError, require, suggestion
from pfsc_drake.robot.models.files import packages_for, read_with_inclusions, resolve_model
from pfsc_drake.robot.models.inspection import inspect_model
from pfsc_drake.robot.models.joint_edits import actuator_of, drivable_joints
from pfsc_drake.robot.models.model_xml import ModelXml, read_model_xml
from pfsc_drake.robot.models.reading import drive_joints


def add_actuators(
    plant: MultibodyPlant,
    model: str | Path,
    joints: Iterable[str] | None = None,
    *,
    effort_limits: Mapping[str, float] | None = None,
) -> list[JointActuator]:
    """Add the actuators that a model's joints lack, with the effort limits that the model gives.

    Drake adds actuators to joints of a URDF only where there is a ``<transmission>``, and forgets
    their effort limits otherwise::

        Parser(plant).AddModels("ur10e.urdf")
        add_actuators(plant, "ur10e.urdf")
        plant.Finalize()

    Args:
        plant: The plant with the model's joints, not finalized.
        model: File of the model, URDF, SDF or MJCF; or name of a shipped one.
        joints: Names of the joints to drive. All that the model names if omitted, without those
            that mimic others or carry a spring.
        effort_limits: Effort limits [Nm or N] of joints by name, in place of the model's.

    Returns:
        The actuators that were added, base first; existing ones are unchanged.

    Raises:
        InputError: If the plant is finalized, the model cannot be read, a named joint cannot be
            driven or has an actuator, or an effort limit is not positive.
    """
    if plant.is_finalized():
        raise InputError("plant: is finalized; allowed: add_actuators before Finalize()")
    file = resolve_model(model)
    models = read_with_inclusions(file, packages_for(file, read_model_xml(file).content, {}))
    facts, drivable = inspect_model(models), drivable_joints(plant)
    if joints is None:
        names = _joint_names(models) - facts.mimics.keys()
    else:
        names = set(joints)
        _require_known("joints", names, drivable)
    chosen = [joint for joint in drivable if joint.name() in names]
    limits = effort_limits or {}
    _require_known("effort_limits", limits, (j for j in chosen if actuator_of(plant, j) is None))
    for name, limit in limits.items():
        require(limit > 0.0, f"effort_limits: {name}", limit, "a positive number [Nm or N]")
    return drive_joints(plant, chosen, file, {**facts.effort_limits, **limits})


def _require_known(key: str, names: Iterable[str], joints: Iterable[Joint]) -> None:
    """Refuse names that are not names of joints."""
    known = [joint.name() for joint in joints]
    for name in names:
        hint = suggestion(name, known)
        if name not in known:
            allowed = ", ".join(known) or "none, all joints have actuators"
            raise InputError(f"{key}: '{name}'; allowed: {allowed}{hint}")


def _joint_names(models: Iterable[ModelXml]) -> set[str]:
    """Return the names of all joints that model files have."""
    elements = (element for model in models for element in model.root.within())
    return {
        element.attributes["name"]
        for element in elements
        if element.name == "joint" and "name" in element.attributes
    }
