"""Where links, rotors and friction stand among the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.model.parameters import LINK_PARAMETERS, PER_LINK
from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.parameters import NUM_ARMS


@dataclass(frozen=True, eq=False)
class Layout:
    """Indices of the parameters of a robot with N joints.

    Attributes:
        names: Of the n parameters, see :func:`~identification.model.parameters.parameter_names`.
        links: Ten indices of each link, shape (N, 10); (0, 10) for a DELTA robot.
        rotors: Of the rotor inertias, shape (N,); empty for a DELTA robot.
        masses: Of the slides' masses and the plate's of a DELTA robot, shape (4,); else empty.
        friction: Of the friction, shape (2 N,) or empty.
    """

    names: list[str]
    links: np.ndarray
    rotors: np.ndarray
    masses: np.ndarray
    friction: np.ndarray

    @classmethod
    def of(cls, names: Sequence[str]) -> "Layout":
        """Return the layout of parameters by their names.

        Args:
            names: All parameters of a robot, in their order.
        """
        kinds = np.array([name.split(".")[1] for name in names])
        is_link = np.isin(kinds, LINK_PARAMETERS)
        return cls(
            list(names),
            np.flatnonzero(is_link).reshape(-1, PER_LINK),
            np.flatnonzero(kinds == "I_M"),
            np.flatnonzero(np.isin(kinds, ["m_q", "m_y"])),
            np.flatnonzero(np.isin(kinds, ["f_c", "f_v"])),
        )

    @property
    def size(self) -> int:
        """Number of parameters n."""
        return len(self.names)

    @property
    def is_delta(self) -> bool:
        """Whether they are those of a DELTA robot."""
        return self.masses.size > 0

    @property
    def slides(self) -> np.ndarray:
        """Of the slides' masses of a DELTA robot, shape (3,)."""
        return self.masses[:NUM_ARMS]

    def link_name(self, link: int) -> str:
        """Return the name of a link, counted from 0: ``link_1``."""
        return self.names[self.links[link, 0]].split(".")[0]

    def check(self, key: str, values: np.ndarray) -> np.ndarray:
        """Return parameters as an array, shape (n,).

        Args:
            key: What they are, for the message.
            values: One number per parameter.

        Raises:
            InputError: If they are not as many, or one is not finite.
        """
        values = np.asarray(values, dtype=float)
        if values.shape != (self.size,):
            raise InputError(f"{key}: shape {values.shape}; must be ({self.size},)")
        if not np.all(np.isfinite(values)):
            first = int(np.argmin(np.isfinite(values)))
            raise InputError(f"{key}: {self.names[first]} = {values[first]}; must be finite")
        return values
