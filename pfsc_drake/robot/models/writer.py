"""Writing of the SDF models of a robot from its parameters.

Frames: the body frame of ``link_i`` is DH frame i, of ``base`` DH frame 0, of ``tool`` the last DH
frame (the flange). Joint i turns about z of DH frame i - 1, and its position is the DH angle
``theta_i``, so zero positions are the zeros of the DH table. The base is welded to the world, whose
gravity is -z. The frame ``tool_point`` lies at the tool point with the orientation of the flange.

Rigid joints: ``joint_i`` between two links, with an actuator whose reflected inertia is D_M,i.
The plant saturates the torque of an actuator at the effort limit, with continuous time, too.

Elastic joints: ``link_{i-1} -> motor_i -> rotor_i -> flex_i -> link_i``. The position of
``motor_i`` is ``q_M,i``; ``flex_i`` is at ``q_J,i - q_M,i`` and carries the spring ``K_s``
and damper ``K_d`` of (2.66). The actuator with reflected inertia D_M,i acts on ``motor_i``. The
plant then obeys (2.65) exactly: a rotor body is a point mass on the joint axis, where it moves as a
point of ``link_{i-1}``; its mass is taken off that link.

Coupling by the rotors' own spin (U in (2.64), the last term of (2.58)) is neglected in both.

Run ``python -m pfsc_drake.robot.models.writer`` to write the shipped models anew.
"""

import xml.etree.ElementTree as ET

import numpy as np

from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.models.robot_parameters import (
    ArmParameters,
    BodyParameters,
    VariantParameters,
    load_parameters,
)
from pfsc_drake.robot.models.visuals import Appearance, add_shapes, format_numbers
from pfsc_drake.yaml.typed import load_file

_SDF_VERSION = "1.9"
_DRAKE_NAMESPACE = "https://drake.mit.edu"
_INERTIA_KEYS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def write_sdf(
    parameters: ArmParameters,
    variant: VariantParameters,
    appearance: Appearance | None = None,
    *,
    collisions: bool = False,
) -> str:
    """Return the text of one SDF model; the same input gives the same text.

    Args:
        parameters: of the robot, as checked by ``load_parameters``.
        variant: which joints move and whether they are elastic.
        appearance: the look of the robot; without it the bodies have no geometry.
        collisions: whether the shapes are collision geometry, too. The robot does not collide with
            itself.

    Raises:
        InputError: if a link is not physical any more once its rotor body is taken off.
    """
    return _Writer(parameters, variant, appearance or Appearance(), collisions).text()


def main() -> None:
    """Write all variants of all shipped serial robots next to their parameters."""
    for path in sorted(models_directory().glob("*/appearance.yaml")):  # parallel robots have none
        parameters = load_parameters(path.with_name("parameters.yaml"))
        appearance = load_file(Appearance, path)
        for variant in parameters.variants:
            text = write_sdf(parameters, variant, appearance)
            path.with_name(f"{variant.name}.sdf").write_text(text, encoding="utf-8")


class _Writer:
    """Builds the element tree of one model."""

    def __init__(
        self,
        parameters: ArmParameters,
        variant: VariantParameters,
        appearance: Appearance,
        collisions: bool,
    ):
        self._robot = parameters
        self._appearance = appearance
        self._collisions = collisions
        self._elasticity = (
            parameters.elasticities[variant.elasticity] if variant.elasticity else None
        )
        self._table = parameters.denavit_hartenberg.table()
        self._fixed = np.deg2rad(variant.fixed_deg)
        self._moving = self._table.axes - self._fixed.size
        self._sdf = ET.Element("sdf", {"version": _SDF_VERSION, "xmlns:drake": _DRAKE_NAMESPACE})
        self._sdf.append(
            ET.Comment(" Written by pfsc_drake.robot.models.writer from parameters.yaml. ")
        )
        self._model = ET.SubElement(self._sdf, "model", name=variant.name)

    def text(self) -> str:
        self._link("base", parent=None)
        self._weld("weld_base", "world", "base")
        for i in range(self._table.axes):
            self._axis(i)
        self._tool()
        if self._collisions:
            self._ignore_self_collisions()
        ET.indent(self._sdf, space="  ")
        body = ET.tostring(self._sdf, encoding="unicode")
        return f'<?xml version="1.0"?>\n{body}\n'

    def _axis(self, i: int) -> None:
        """Add link i + 1 with the joint (or weld) that connects it; i counts from 0."""
        parent = self._robot.links[i - 1].name if i else "base"
        link = self._robot.links[i]
        theta = 0.0 if i < self._moving else float(self._fixed[i - self._moving])
        a, d, alpha = float(self._table.a[i]), float(self._table.d[i]), float(self._table.alpha[i])
        # (2.4): Rz(theta) Tz(d) Tx(a) Rx(alpha), as position and roll, pitch, yaw.
        pose = [a * np.cos(theta), a * np.sin(theta), d, alpha, 0.0, theta]
        self._axis_shapes(i, parent)
        if i >= self._moving:
            self._link(link.name, parent, pose, self._without_rotor(link, i))
            self._weld(f"weld_{i + 1}", parent, link.name)
        elif self._elasticity is None:
            self._link(link.name, parent, pose, link)
            self._drive_joint(f"joint_{i + 1}", i, parent, link.name)
        else:
            rotor = f"rotor_{i + 1}"
            self._link(link.name, parent, pose, self._without_rotor(link, i))
            self._drive_joint(f"motor_{i + 1}", i, parent, rotor)
            self._flexible_joint(f"flex_{i + 1}", i, rotor, link.name)

    def _axis_shapes(self, i: int, parent: str) -> None:
        """Add the shapes of drive i to its rotor body, or to the link that carries it."""
        shapes = self._appearance.axes[i] if i < len(self._appearance.axes) else []
        if self._elasticity is None or i >= self._moving:
            carrier = self._model.find(f"link[@name='{parent}']")
            assert carrier is not None
            add_shapes(carrier, shapes, self._appearance, collisions=self._collisions)
            return
        name, mass, body = f"rotor_{i + 1}", self._robot.rotors.body_mass, None
        if mass > 0:
            body = BodyParameters(name, mass, center_of_mass=np.zeros(3), inertia=np.zeros(6))
        rotor = self._link(name, parent, [0.0] * 6, body)
        material = self._appearance.elastic_axis_material
        add_shapes(rotor, shapes, self._appearance, material=material, collisions=self._collisions)

    def _without_rotor(self, link: BodyParameters, i: int) -> BodyParameters:
        """Return the link without the point mass of the next rotor body at its origin."""
        if self._elasticity is None or i + 1 >= self._moving:
            return link
        mass = link.mass - self._robot.rotors.body_mass
        com = link.center_of_mass * (link.mass / mass)

        def steiner(p: np.ndarray) -> np.ndarray:
            x, y, z = p
            return np.array([y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])

        about_origin = link.inertia + link.mass * steiner(link.center_of_mass)
        return BodyParameters(
            name=link.name,
            mass=mass,
            center_of_mass=com,
            inertia=about_origin - mass * steiner(com),
        )

    def _tool(self) -> None:
        tool = self._robot.tool
        flange = self._robot.links[-1].name
        self._link(tool.name, flange, [0.0] * 6, tool)
        self._weld("weld_tool", flange, tool.name)
        frame = ET.SubElement(self._model, "frame", name="tool_point", attached_to=tool.name)
        ET.SubElement(frame, "pose").text = format_numbers([*tool.tool_point, 0.0, 0.0, 0.0])

    def _link(
        self,
        name: str,
        parent: str | None,
        pose: list[float] | None = None,
        body: BodyParameters | None = None,
    ) -> ET.Element:
        """Add a body at a pose in its parent; without mass properties they are zero."""
        link = ET.SubElement(self._model, "link", name=name)
        if parent is not None and pose is not None:
            ET.SubElement(link, "pose", relative_to=parent).text = format_numbers(pose)
        inertial = ET.SubElement(link, "inertial")
        if body is not None:
            position = [*body.center_of_mass, 0.0, 0.0, 0.0]
            ET.SubElement(inertial, "pose").text = format_numbers(position)
        ET.SubElement(inertial, "mass").text = format_numbers([body.mass if body else 0.0])
        inertia = ET.SubElement(inertial, "inertia")
        for key, value in zip(_INERTIA_KEYS, body.inertia if body else np.zeros(6), strict=True):
            ET.SubElement(inertia, key).text = format_numbers([value])
        shapes = self._appearance.bodies.get(name, [])
        add_shapes(link, shapes, self._appearance, collisions=self._collisions)
        return link

    def _joint(self, name: str, kind: str, parent: str, child: str) -> ET.Element:
        joint = ET.SubElement(self._model, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent").text = parent
        ET.SubElement(joint, "child").text = child
        return joint

    def _weld(self, name: str, parent: str, child: str) -> None:
        self._joint(name, "fixed", parent, child)

    def _revolute(self, name: str, parent: str, child: str) -> tuple[ET.Element, ET.Element]:
        """Add a joint about z of the parent's frame; returns the joint and its axis."""
        joint = self._joint(name, "revolute", parent, child)
        ET.SubElement(joint, "pose", relative_to=parent).text = format_numbers([0.0] * 6)
        axis = ET.SubElement(joint, "axis")
        ET.SubElement(axis, "xyz").text = "0 0 1"
        return joint, axis

    def _drive_joint(self, name: str, i: int, parent: str, child: str) -> None:
        """Add the joint that drive i moves, with limits and the drive's reflected inertia."""
        joint, axis = self._revolute(name, parent, child)
        limits = self._robot.joint_limits
        limit = ET.SubElement(axis, "limit")
        for tag, values in (
            ("lower", limits.position_lower),
            ("upper", limits.position_upper),
            ("effort", limits.effort),
            ("velocity", limits.velocity),
            ("drake:acceleration", limits.acceleration),
        ):
            ET.SubElement(limit, tag).text = format_numbers([values[i]])
        rotors = self._robot.rotors
        ET.SubElement(joint, "drake:rotor_inertia").text = format_numbers([rotors.inertia[i]])
        ET.SubElement(joint, "drake:gear_ratio").text = format_numbers([rotors.gear_ratio[i]])

    def _flexible_joint(self, name: str, i: int, parent: str, child: str) -> None:
        """Add joint i's spring and damper; effort 0 means that there is no actuator."""
        assert self._elasticity is not None
        _, axis = self._revolute(name, parent, child)
        dynamics = ET.SubElement(axis, "dynamics")
        ET.SubElement(dynamics, "damping").text = format_numbers([self._elasticity.damping[i]])
        ET.SubElement(dynamics, "spring_reference").text = "0"
        stiffness = format_numbers([self._elasticity.stiffness[i]])
        ET.SubElement(dynamics, "spring_stiffness").text = stiffness
        ET.SubElement(ET.SubElement(axis, "limit"), "effort").text = "0"

    def _ignore_self_collisions(self) -> None:
        group = ET.SubElement(self._model, "drake:collision_filter_group", name="robot")
        for link in self._model.findall("link"):
            ET.SubElement(group, "drake:member").text = link.get("name")
        ET.SubElement(group, "drake:ignored_collision_filter_group").text = "robot"


if __name__ == "__main__":
    main()
