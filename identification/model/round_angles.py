"""Angles of a model that were rounded when it was written, as 1.5708 for a right angle.

Axes that are parallel or at right angles but for 4e-6 rad have another set of base parameters than
those of the robot: gravity then acts about an upright axis, and some more are seen, by 4e-6 of what
others do. Their estimates are noise of any size.
"""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix

from pfsc_drake.robot.serial.chain import SerialChain

# what angles of a robot's design are multiples of
STEP_DEG = 15.0
# how far off such a multiple an angle is taken for rounded [rad]
TOLERANCE = 1e-4
# of a rotation matrix, by which it is off without having been rounded
_EXACT = 1e-12


@dataclass(frozen=True, eq=False)
class RoundedChain:
    """A chain whose angles are what they were before they were rounded.

    Attributes:
        chain: The chain.
        note: What was changed, one line; empty if nothing was.
    """

    chain: SerialChain
    note: str


def with_round_angles(chain: SerialChain) -> RoundedChain:
    """Return a chain with joints turned by multiples of 15 degrees where they nearly are.

    Roll, pitch and yaw of a joint's frame in the one before count, each by itself.

    Args:
        chain: As the model file has it.
    """
    links, changed, most = [], [], 0.0
    for link in chain.links:
        rounded = round_rotation(link.R_PF)
        off = float(np.abs(rounded - link.R_PF).max())
        if off > _EXACT:
            changed.append(link.name)
            most = max(most, off)
            link = replace(link, R_PF=rounded)
        links.append(link)
    if not changed:
        return RoundedChain(chain, "")
    note = (
        f"the model's angles at {', '.join(changed)} are up to {most:.2g} rad off multiples of "
        f"{STEP_DEG:g} deg; taken for rounded, and put right"
    )
    return RoundedChain(replace(chain, links=tuple(links)), note)


def round_rotation(R: np.ndarray) -> np.ndarray:
    """Return a rotation with roll, pitch and yaw on multiples of 15 degrees that they are near.

    Args:
        R: Shape (3, 3).
    """
    angles = RollPitchYaw(RotationMatrix(R)).vector()
    step = np.deg2rad(STEP_DEG)
    nearest = step * np.round(angles / step)
    near = np.abs(angles - nearest) <= TOLERANCE
    if not near.any():
        return R
    rounded = RollPitchYaw(np.where(near, nearest, angles)).ToRotationMatrix().matrix()
    # sines and cosines of right angles are zero and one
    rounded = np.where(np.abs(rounded - np.round(rounded)) < _EXACT, np.round(rounded), rounded)
    return rounded if np.abs(rounded - R).max() <= 3.0 * TOLERANCE else R
