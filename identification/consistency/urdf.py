"""A serial robot as URDF, from its chain and its parameters."""

import xml.etree.ElementTree as ET

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from identification.consistency.check import central_inertia, layout_of
from identification.consistency.parameter_files import flange, links_without_tool
from identification.model.parameters import link_parameters
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.visuals import format_numbers
from pfsc_drake.robot.serial.links import ChainLink

BASE = "base"
_DRAKE = "https://drake.mit.edu"
# where the attributes of an <inertia> stand in its matrix
INERTIA_ENTRIES = {
    "ixx": (0, 0),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyy": (1, 1),
    "iyz": (1, 2),
    "izz": (2, 2),
}


def urdf_text(subject: Subject, parameters: np.ndarray) -> str:
    """Return a serial robot as URDF.

    The link frames are those of the chain, counted from the frame that stands at the scenario's
    ``robot.base_pose``. Rotors are in the transmissions, as Drake has them; elastic joints are
    rigid here. What the robot's parameter file says of a tool is a link of its own. Friction of a
    robot without such a file is in the joints' dynamics; that of others belongs to the scenario.

    Args:
        subject: A serial robot of N joints.
        parameters: Of the robot, with or without friction, shape (n,).

    Raises:
        InputError: If the robot is no chain, there are not as many parameters or one is not finite.
    """
    chain, robot, layout = subject.chain, subject.parameters, layout_of(subject, parameters)
    if chain is None:
        raise InputError(f"{subject.name}: has loops; allowed as URDF: serial robots")
    model = ET.Element("robot", {"name": subject.name, "xmlns:drake": _DRAKE})
    ET.SubElement(model, "link", name=BASE)
    names = [f"link_{i + 1}" for i in range(chain.dimension)]
    if robot is not None:
        names = [link.name for link in robot.links]
    X_WB = RigidTransform() if subject.block is None else subject.block.base_pose.transform()
    for i, own in enumerate(links_without_tool(subject, parameters)):
        X_PF = _pose(chain.links[i].R_PF, chain.links[i].p_PF)
        joint = _moving_joint(model, chain.links[i], subject.acceleration_limit[i])
        _connect(joint, *(names[i - 1 : i + 1] if i else (BASE, names[0])))
        _place(joint, X_PF if i else X_WB.inverse() @ X_PF)
        if robot is None:
            friction = parameters[layout.friction].reshape(-1, 2)
            coulomb, viscous = friction[i] if friction.size else (0.0, 0.0)
            _numbers(joint, "dynamics", damping=viscous, friction=coulomb)
        _body(model, names[i], own)
        rotor = parameters[layout.rotors[i]]
        _transmission(model, chain.links[i].name, rotor, subject.gear_ratio[i])
    tip, X_LT = names[-1], _pose(chain.R_LT, chain.p_LT)
    if robot is not None:
        tool = robot.tool
        X_LB = _pose(*flange(chain, tool))
        center = tool.center_of_mass
        around = tool.mass * (center @ center * np.eye(3) - np.outer(center, center))
        _body(model, tool.name, link_parameters(tool.mass, center, tool.inertia_matrix() + around))
        _weld(model, tip, tool.name, X_LB)
        tip, X_LT = tool.name, X_LB.inverse() @ X_LT
    frame = "tool_point" if subject.block is None else subject.block.tool_frame.split("::")[-1]
    ET.SubElement(model, "link", name=frame)
    _weld(model, tip, frame, X_LT)
    ET.indent(model, space="  ")
    return f'<?xml version="1.0"?>\n{ET.tostring(model, encoding="unicode")}\n'


def _pose(R: np.ndarray, p: np.ndarray) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p)


def _numbers(parent: ET.Element, tag: str, **values: float) -> None:
    """Add an element with numbers for attributes."""
    texts = {key: format_numbers([value]) for key, value in values.items()}
    ET.SubElement(parent, tag, texts)


def _place(element: ET.Element, X: RigidTransform) -> None:
    angles = RollPitchYaw(X.rotation()).vector()
    place = {"xyz": format_numbers(X.translation()), "rpy": format_numbers(angles)}
    ET.SubElement(element, "origin", place)


def _connect(joint: ET.Element, parent: str, child: str) -> None:
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)


def _weld(model: ET.Element, parent: str, child: str, X: RigidTransform) -> None:
    joint = ET.SubElement(model, "joint", name=f"weld_{child}", type="fixed")
    _connect(joint, parent, child)
    _place(joint, X)


def _moving_joint(model: ET.Element, link: ChainLink, acceleration_limit: float) -> ET.Element:
    lower, upper = link.position_limits
    limited = bool(np.isfinite(lower) and np.isfinite(upper))
    kind = ("revolute" if limited else "continuous") if link.is_revolute else "prismatic"
    joint = ET.SubElement(model, "joint", name=link.name, type=kind)
    ET.SubElement(joint, "axis", xyz=format_numbers(link.axis))
    limits = {"effort": link.effort_limit, "velocity": link.velocity_limit}
    limits |= {"lower": lower, "upper": upper} if limited else {}
    limits |= {"drake:acceleration": acceleration_limit}
    given = {key: float(value) for key, value in limits.items() if np.isfinite(value)}
    _numbers(joint, "limit", **given)
    return joint


def _body(model: ET.Element, name: str, parameters: np.ndarray) -> None:
    """Add a link with the inertia about its centre of mass."""
    mass, center, I_C = central_inertia(parameters)
    inertial = ET.SubElement(ET.SubElement(model, "link", name=name), "inertial")
    _place(inertial, RigidTransform(center))
    _numbers(inertial, "mass", value=mass)
    _numbers(inertial, "inertia", **{key: I_C[entry] for key, entry in INERTIA_ENTRIES.items()})


def _transmission(model: ET.Element, joint: str, rotor_inertia: float, gear_ratio: float) -> None:
    transmission = ET.SubElement(model, "transmission", name=f"transmission_{joint}")
    ET.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
    element = ET.SubElement(transmission, "joint", name=joint)
    ET.SubElement(element, "hardwareInterface").text = "EffortJointInterface"
    actuator = ET.SubElement(transmission, "actuator", name=f"drive_{joint}")
    ET.SubElement(actuator, "hardwareInterface").text = "EffortJointInterface"
    _numbers(actuator, "drake:rotor_inertia", value=rotor_inertia)
    _numbers(actuator, "drake:gear_ratio", value=gear_ratio)
