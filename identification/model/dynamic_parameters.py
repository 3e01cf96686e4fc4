"""Dynamic parameters of a robot: order, names, units and simulated values.

A serial robot with N joints has, in this order,

- ten of every link ``i = 1..N``, in the link frame of
  :class:`~pfsc_drake.robot.serial.links.ChainLink`, about its origin:
  ``m`` [kg], ``mx my mz`` [kg m] (mass times centre of mass), ``Ixx Ixy Ixz Iyy Iyz Izz`` [kg m^2],
  the entries of the inertia matrix;
- the rotor inertia ``I_M`` of every joint at the motor side [kg m^2]; at the joint side if the
  gear ratio is unknown (1);
- Coulomb and viscous friction ``f_c``, ``f_v`` of every joint at the joint side (2.41).

A link includes the masses and the inertias of its rotors at rest (Sec. 2.4.6). A DELTA robot has
``m_q1 m_q2 m_q3 m_y`` [kg] of Sec. 2.4.5 instead of the first two groups.
"""

import numpy as np

from identification.model.subject import Subject
from pfsc_drake.robot.delta.delta_parameters import NUM_ARMS

LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_LINK_UNITS = ["kg"] + ["kg m"] * 3 + ["kg m^2"] * 6
# rows and columns of the inertia matrix among them
_ROWS, _COLUMNS = [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]
PER_LINK = len(LINK_PARAMETERS)


def parameter_names(subject: Subject, friction: bool = True) -> list[str]:
    """Return the names of the parameters, ``link_3.Ixy`` or ``joint_2.f_c``, joints from 1.

    Args:
        subject: The robot.
        friction: Whether friction is among them.
    """
    joints = range(1, subject.dimension + 1)
    if subject.chain is None:
        names = [*(f"slide_{j}.m_q" for j in joints), "plate.m_y"]
    else:
        names = [f"link_{j}.{name}" for j in joints for name in LINK_PARAMETERS]
        names += [f"joint_{j}.I_M" for j in joints]
    if friction:
        names += [f"joint_{j}.{name}" for j in joints for name in ("f_c", "f_v")]
    return names


def parameter_units(subject: Subject, friction: bool = True) -> list[str]:
    """Return the units of the parameters, in the order of :func:`parameter_names`.

    Args:
        subject: The robot.
        friction: Whether friction is among them.
    """
    n = subject.dimension
    if subject.chain is None:
        units = ["kg"] * (NUM_ARMS + 1)
    else:
        units = _LINK_UNITS * n
        # a slide whose drive is not modelled as a rotor has a mass there
        units += [
            "kg" if unit == "m" and ratio == 1.0 else "kg m^2"
            for unit, ratio in zip(subject.joint_units, subject.gear_ratio, strict=True)
        ]
    if friction:
        for unit in subject.joint_units:
            units += ["Nm", "Nm s/rad"] if unit == "rad" else ["N", "N s/m"]
    return units


def true_parameters(subject: Subject, friction: bool = True) -> np.ndarray:
    """Return the parameters of the robot's model.

    Args:
        subject: The robot.
        friction: Whether friction is among them.

    Returns:
        Shape (n,); friction that is unknown is NaN.
    """
    if subject.chain is None:
        assert subject.delta is not None
        masses = subject.delta.parameters.masses
        inertial = np.array([*[masses.effective_slide] * NUM_ARMS, masses.effective_plate])
    else:
        inertial = np.concatenate(
            [
                *(
                    link_parameters(link.mass, link.p_LC, link.inertia_about_origin)
                    for link in subject.chain.links
                ),
                subject.chain.D_M / subject.gear_ratio**2,
            ]
        )
    if not friction:
        return inertial
    unknown = np.full(subject.dimension, np.nan)
    coulomb = unknown if subject.coulomb is None else subject.coulomb
    viscous = unknown if subject.viscous is None else subject.viscous
    return np.concatenate([inertial, np.column_stack([coulomb, viscous]).ravel()])


def link_parameters(mass: float, p_LC: np.ndarray, I_L: np.ndarray) -> np.ndarray:
    """Return the ten parameters of a link, shape (10,).

    Args:
        mass: Mass [kg].
        p_LC: Centre of mass in the link frame [m], shape (3,).
        I_L: Inertia about the origin of the link frame [kg m^2], shape (3, 3).
    """
    return from_moments(mass, mass * np.asarray(p_LC), np.asarray(I_L))


def from_moments(mass: float, moment: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Return the ten parameters of a link, shape (10,); the inverse of :func:`link_moments`.

    Args:
        mass: Mass [kg].
        moment: Mass times centre of mass in the link frame [kg m], shape (3,).
        inertia: About the origin of the link frame [kg m^2], shape (3, 3).
    """
    return np.concatenate([[mass], moment, inertia[_ROWS, _COLUMNS]])


def link_moments(parameters: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], first moment [kg m] (3,) and inertia about the origin [kg m^2] (3, 3).

    Args:
        parameters: The ten parameters of a link, shape (10,).
    """
    inertia = np.zeros((3, 3))
    inertia[_ROWS, _COLUMNS] = inertia[_COLUMNS, _ROWS] = parameters[4:]
    return float(parameters[0]), np.array(parameters[1:4]), inertia


def transform_parameters(parameters: np.ndarray, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the ten parameters of a body about another frame, shape (10,).

    Args:
        parameters: About frame L, shape (10,).
        R: Orientation of L in the other frame, shape (3, 3).
        p: Origin of L in the other frame [m], shape (3,).
    """
    mass, moment, inertia = link_moments(parameters)
    turned, S_p = R @ moment, _skew(p)
    S_m = _skew(turned)
    about = R @ inertia @ R.T - mass * S_p @ S_p - S_p @ S_m - S_m @ S_p
    return from_moments(mass, turned + mass * p, about)


def _skew(p: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
