"""Sites of MJCF models as frames of their bodies, as in MuJoCo."""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame
from scipy.spatial.transform import Rotation

from pfsc_drake.robot.models.mjcf_classes import Attributes, DefaultClasses
from pfsc_drake.robot.models.model_parts import ANY, ModelPart
from pfsc_drake.robot.models.model_xml import Element, ModelXml

# representations of an orientation, and their numbers of values
_OF_AXES = {"axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}


def add_sites(plant: MultibodyPlant, models: list[ModelXml]) -> None:
    """Add the sites of an MJCF model that have a name to a plant, as frames of their bodies.

    Sites with the name of a body or a frame are omitted.

    Args:
        plant: The plant with the model, not finalized.
        models: The model and what it includes.

    Raises:
        InputError: If a pose is not made of numbers.
    """
    classes = DefaultClasses.of(models)
    for model in (model for model in models if model.root.name.startswith("mujoco")):
        angles = _Angles(model)
        for world in model.root.all("worldbody"):
            for body, element, attributes in classes.below(world, "site"):
                name = "world" if body is world else body.attributes.get("name", "")
                site = attributes.get("name", "")
                if site and not plant.HasFrameNamed(site) and plant.HasBodyNamed(name):
                    frame = plant.GetBodyByName(name).body_frame()
                    plant.AddFrame(FixedOffsetFrame(site, frame, angles.pose(element, attributes)))


class _Angles:
    """Poses with the conventions of an MJCF model's compiler options.

    Args:
        model: The model.
    """

    def __init__(self, model: ModelXml) -> None:
        self._model, self._unit, self._order = model, np.pi / 180.0, "XYZ"
        for compiler in model.root.all("compiler"):
            if compiler.attributes.get("angle") == "radian":
                self._unit = 1.0
            # lower case means intrinsic rotations: upper case in scipy
            self._order = compiler.attributes.get("eulerseq", self._order.swapcase()).swapcase()

    def pose(self, element: Element, attributes: Attributes) -> RigidTransform:
        """Return the pose of an element in its body.

        Args:
            element: The element.
            attributes: Its attributes with those of its class.

        Raises:
            InputError: If it has a wrong count of numbers.
        """
        part = ModelPart(self._model, element, element.name)

        def numbers(key: str, count: int) -> np.ndarray | None:
            if key not in attributes:
                return None
            words = attributes[key].split()
            if len(words) != count:
                part.refuse(key, attributes[key], f"{count} numbers")
            return np.array([part.number(key, word, ANY) for word in words])

        own = [key for key in _OF_AXES if key in element.attributes]
        inherited = [key for key in _OF_AXES if key in attributes]
        # a quaternion counts where nothing else is set, even by a class
        kind = next(iter([*own, *inherited, "quat"]))
        position, values = numbers("pos", 3), numbers(kind, _OF_AXES.get(kind, 4))
        rotation = np.eye(3) if values is None else self._rotation(kind, values)
        return RigidTransform(
            RotationMatrix(rotation), np.zeros(3) if position is None else position
        )

    def _rotation(self, kind: str, values: np.ndarray) -> np.ndarray:
        if kind == "quat":
            return Rotation.from_quat(np.roll(values, -1)).as_matrix()
        if kind == "axisangle":
            axis = values[:3] / np.linalg.norm(values[:3])
            return Rotation.from_rotvec(self._unit * values[3] * axis).as_matrix()
        if kind == "euler":
            return Rotation.from_euler(self._order, self._unit * values).as_matrix()
        if kind == "xyaxes":
            x = values[:3] / np.linalg.norm(values[:3])
            y = values[3:] - (values[3:] @ x) * x
            y = y / np.linalg.norm(y)
            return np.stack([x, y, np.cross(x, y)], axis=1)
        return _shortest(values / np.linalg.norm(values))


def _shortest(z: np.ndarray) -> np.ndarray:
    """Return the smallest rotation that turns the z axis into a direction."""
    axis = np.cross([0.0, 0.0, 1.0], z)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return np.diag([1.0, np.sign(z[2]), np.sign(z[2])])
    return Rotation.from_rotvec(np.arctan2(sine, z[2]) / sine * axis).as_matrix()
