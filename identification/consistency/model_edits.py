"""Model file of a robot with identified inertias: an edited copy of its own, or a new URDF."""

import copy
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from diagrams.robots.model import locate_model, read_robot
from diagrams.scenario import RobotParameters as RobotBlock
from identification.consistency.parameter_files import (
    central_inertia,
    flange,
    layout_of,
    link_faults,
    links_without_tool,
    tool_parameters,
)
from identification.model.dynamic_parameters import (
    link_parameters,
    transform_parameters,
    true_parameters,
)
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.model_text import absolute_names
from pfsc_drake.robot.models.model_xml import Element, ModelXml, read_model_xml
from pfsc_drake.robot.models.visuals import format_numbers
from pfsc_drake.robot.serial.links import ChainLink

BASE = "base"
_DRAKE = "https://drake.mit.edu"
# positions of the attributes of an <inertia> in its matrix
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

    The link frames are those of the chain, relative to the frame at the scenario's
    ``robot.base_pose``. Rotors are in the transmissions, as in Drake; elastic joints are rigid
    here. A tool from the robot's parameter file is a link of its own. Friction of a robot without
    such a file is in the joints' dynamics; otherwise it belongs to the scenario.

    Args:
        subject: A serial robot of N joints.
        parameters: Parameters of the robot, with or without friction, shape (n,).

    Raises:
        InputError: If the robot is not a chain, or the parameters have a wrong number or value.
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
        _add_origin(joint, X_PF if i else X_WB.inverse() @ X_PF)
        if robot is None:
            friction = parameters[layout.friction].reshape(-1, 2)
            coulomb, viscous = friction[i] if friction.size else (0.0, 0.0)
            _numbers(joint, "dynamics", damping=viscous, friction=coulomb)
        _body(model, names[i], own)
        rotor = parameters[layout.rotors[i]]
        _urdf_transmission(model, chain.links[i].name, rotor, subject.gear_ratio[i])
    tip, X_LT = names[-1], _pose(chain.R_LT, chain.p_LT)
    if robot is not None:
        tool = robot.tool
        X_LB = _pose(*flange(chain, tool))
        _body(model, tool.name, tool_parameters(tool))
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


def _add_origin(element: ET.Element, X: RigidTransform) -> None:
    angles = RollPitchYaw(X.rotation()).vector()
    pose = {"xyz": format_numbers(X.translation()), "rpy": format_numbers(angles)}
    ET.SubElement(element, "origin", pose)


def _connect(joint: ET.Element, parent: str, child: str) -> None:
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)


def _weld(model: ET.Element, parent: str, child: str, X: RigidTransform) -> None:
    joint = ET.SubElement(model, "joint", name=f"weld_{child}", type="fixed")
    _connect(joint, parent, child)
    _add_origin(joint, X)


def _moving_joint(model: ET.Element, link: ChainLink, acceleration_limit: float) -> ET.Element:
    lower, upper = link.position_limits
    limited = bool(np.isfinite(lower) and np.isfinite(upper))
    kind = ("revolute" if limited else "continuous") if link.is_revolute else "prismatic"
    joint = ET.SubElement(model, "joint", name=link.name, type=kind)
    ET.SubElement(joint, "axis", xyz=format_numbers(link.axis))
    limits = {"effort": link.effort_limit, "velocity": link.velocity_limit}
    limits |= {"lower": lower, "upper": upper} if limited else {}
    limits |= {"drake:acceleration": acceleration_limit}
    finite = {key: float(value) for key, value in limits.items() if np.isfinite(value)}
    _numbers(joint, "limit", **finite)
    return joint


def _body(model: ET.Element, name: str, parameters: np.ndarray) -> None:
    """Add a link with the inertia about its centre of mass."""
    mass, center, I_C = central_inertia(parameters)
    inertial = ET.SubElement(ET.SubElement(model, "link", name=name), "inertial")
    _add_origin(inertial, RigidTransform(center))
    _numbers(inertial, "mass", value=mass)
    _numbers(inertial, "inertia", **{key: I_C[entry] for key, entry in INERTIA_ENTRIES.items()})


def _urdf_transmission(
    model: ET.Element, joint: str, rotor_inertia: float, gear_ratio: float
) -> None:
    transmission = ET.SubElement(model, "transmission", name=f"transmission_{joint}")
    ET.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
    element = ET.SubElement(transmission, "joint", name=joint)
    ET.SubElement(element, "hardwareInterface").text = "EffortJointInterface"
    actuator = ET.SubElement(transmission, "actuator", name=f"drive_{joint}")
    ET.SubElement(actuator, "hardwareInterface").text = "EffortJointInterface"
    _numbers(actuator, "drake:rotor_inertia", value=rotor_inertia)
    _numbers(actuator, "drake:gear_ratio", value=gear_ratio)


_KINDS = (".urdf", ".sdf")
_ROTOR = "drake:rotor_inertia"


@dataclass(frozen=True)
class _Edit:
    """Replacement of a file's bytes from start to end by a text."""

    start: int
    end: int
    text: str


def edit_model(subject: Subject, parameters: np.ndarray) -> str:
    """Return the text of a robot's model file with identified inertias.

    Changes of a link beyond its model go into the heaviest of its bodies; the others, such as a
    tool or a gripper with its fixed fingers, stay the same. Rotor inertias are at the drives;
    friction is left to the scenario, and damping in the model stays.

    Args:
        subject: A serial robot read from a URDF or an SDF file with rigid joints.
        parameters: Parameters of the robot, with or without friction, shape (n,).

    Raises:
        InputError: If the model is of another kind or spread over several files, or a body would
            not be physical beside the others of its link.
    """
    assert subject.block is not None and subject.chain is not None
    file = locate_model(subject.block, subject.folder)
    if file.suffix.lower() not in _KINDS:
        raise InputError(f"{file}: no inertias can be set; allowed: {', '.join(_KINDS)}")
    model, layout = read_model_xml(file), layout_of(subject, parameters)
    plain = replace(copy.deepcopy(subject.block), elastic=RobotBlock().elastic, joint_damping=[])
    plant, _ = read_robot(plain, subject.folder)
    if plant.num_velocities() != subject.dimension:
        raise InputError(f"{file}: elastic or other joints; allowed: a rigid chain of them")
    change = (layout.check("parameters", parameters) - _own(subject, parameters))[layout.links]
    edits = [_Edit(element.start, element.end, text) for element, text in absolute_names(model)]
    for name, own in zip(subject.joint_names, change, strict=True):
        edits.append(_inertial(model, plant, name, own))
    for name, inertia in zip(subject.joint_names, parameters[layout.rotors], strict=True):
        edits += _rotor(model, name, float(inertia))
    content = model.content
    for edit in sorted(edits, key=lambda edit: -edit.start):
        content = content[: edit.start] + edit.text.encode() + content[edit.end :]
    return content.decode("utf-8")


def _own(subject: Subject, parameters: np.ndarray) -> np.ndarray:
    """Return the parameters that the model has, as many as were identified."""
    return np.nan_to_num(true_parameters(subject)[: np.size(parameters)])


def _inertial(model: ModelXml, plant: MultibodyPlant, joint: str, change: np.ndarray) -> _Edit:
    """Return the edit of the heaviest body behind a joint; the change is in the link frame."""
    frame, context = plant.GetJointByName(joint).frame_on_child(), plant.CreateDefaultContext()
    bodies = plant.GetBodiesWeldedTo(frame.body())
    body = max(bodies, key=lambda body: body.default_mass())
    X_BL = plant.CalcRelativeTransform(context, body.body_frame(), frame)
    own = _parameters(plant, body) + transform_parameters(
        change, X_BL.rotation().matrix(), X_BL.translation()
    )
    faults = link_faults(own)
    if faults:
        others = ", ".join(other.name() for other in bodies if other is not body) or "nothing"
        raise InputError(f"{model.file}: link '{body.name()}' beside {others}: {faults[0]}")
    links = [e for e in model.root.within() if e.name == "link"]
    named = [e for e in links if e.attributes.get("name") == body.name()]
    inertial = named[0].first("inertial") if len(named) == 1 else None
    if inertial is None:
        raise InputError(
            f"{model.file}: link '{body.name()}' has no <inertial> of its own in this file; "
            "allowed: models in one file"
        )
    write = _urdf_inertial if model.root.name == "robot" else _sdf_inertial
    return _Edit(inertial.start, inertial.end, write(own))


def _parameters(plant: MultibodyPlant, body: RigidBody) -> np.ndarray:
    M = body.default_spatial_inertia()
    return link_parameters(M.get_mass(), M.get_com(), M.CalcRotationalInertia().CopyToFullMatrix3())


def _urdf_inertial(own: np.ndarray) -> str:
    mass, center, I_C = central_inertia(own)
    entries = " ".join(f'{k}="{format_numbers([I_C[e]])}"' for k, e in INERTIA_ENTRIES.items())
    return (
        f'<inertial><origin xyz="{format_numbers(center)}" rpy="0 0 0"/>'
        f'<mass value="{format_numbers([mass])}"/><inertia {entries}/></inertial>'
    )


def _sdf_inertial(own: np.ndarray) -> str:
    mass, center, I_C = central_inertia(own)
    entries = "".join(f"<{k}>{format_numbers([I_C[e]])}</{k}>" for k, e in INERTIA_ENTRIES.items())
    return (
        f"<inertial><pose>{format_numbers([*center, 0.0, 0.0, 0.0])}</pose>"
        f"<mass>{format_numbers([mass])}</mass><inertia>{entries}</inertia></inertial>"
    )


def _rotor(model: ModelXml, joint: str, inertia: float) -> Iterator[_Edit]:
    """Yield the edit of a drive, if the model or the estimate has a rotor there."""
    value = format_numbers([inertia])
    if model.root.name == "robot":
        for transmission in model.root.all("transmission"):
            joint_element = transmission.first("joint")
            actuator = transmission.first("actuator")
            if (
                joint_element is None
                or actuator is None
                or joint_element.attributes.get("name") != joint
            ):
                continue
            yield _child(model, actuator, f'<{_ROTOR} value="{value}"/>')
            return
        if inertia > 0.0:
            end = model.content.rindex(b"</robot>")
            yield _Edit(end, end, _transmission(joint, value))
        return
    joints = [e for e in model.root.within() if e.name == "joint"]
    (element,) = [e for e in joints if e.attributes.get("name") == joint]
    if inertia > 0.0 or element.first(_ROTOR) is not None:
        yield _child(model, element, f"<{_ROTOR}>{value}</{_ROTOR}>")


def _child(model: ModelXml, parent: Element, text: str) -> _Edit:
    """Return the edit that puts the rotor's inertia into an element, or replaces it there."""
    old = parent.first(_ROTOR)
    if old is not None:
        return _Edit(old.start, old.end, text)
    closing = model.content.rfind(b"</", parent.start, parent.end)
    if closing >= 0:
        return _Edit(closing, closing, text)
    slash = model.content.rindex(b"/>", parent.start, parent.end)
    return _Edit(slash, parent.end, f">{text}</{parent.name}>")


def _transmission(joint: str, value: str) -> str:
    return (
        f'  <transmission name="transmission_{joint}">\n'
        "    <type>transmission_interface/SimpleTransmission</type>\n"
        f'    <joint name="{joint}"/>\n'
        f'    <actuator name="drive_{joint}"><{_ROTOR} value="{value}"/></actuator>\n'
        "  </transmission>\n"
    )
