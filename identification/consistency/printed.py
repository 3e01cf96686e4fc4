"""The robot of Tab. C.3: a consistent set near to what the dissertation identified."""

import numpy as np

from identification.consistency.bounds import PhysicalBounds, load_bounds
from identification.consistency.nearest import ConsistentParameters, Prediction, nearest_consistent
from identification.excitation.fourier import FourierTrajectory
from identification.model.analytic_base import analytic_base
from identification.model.comau_base import load_printed_identification
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.robot.models.files import models_directory

# for how many measurements the motion of Tab. C.2 counts: its torques then are nearer to those of
# Tab. C.3 by a quarter to a half, for 1 % more of chi squared
TORQUE_WEIGHT = 100.0
_RATE = 100.0  # Hz, of the torques


def nearest_to_printed(
    subject: Subject, bounds: PhysicalBounds | None = None, torque_weight: float = TORQUE_WEIGHT
) -> ConsistentParameters:
    """Return the consistent parameters nearest to Tab. C.3.

    Chi squared counts the differences to the means in units of the printed standard deviations.

    Args:
        subject: The Comau Racer 1.4 without tool.
        bounds: What is known of its bodies; by default the shipped assumptions.
        torque_weight: For how many measurements the torques on the motion of Tab. C.2 count, in
            units of the noise of Tab. C.4; 0 for chi squared alone.

    Raises:
        InputError: If the robot is another one.
    """
    printed = load_printed_identification()
    base, table = analytic_base(subject), printed.base_parameters
    folder = models_directory() / printed.name
    trajectory = FourierTrajectory.load(folder / "excitation.yaml")
    q, v, a = trajectory.motion(trajectory.sample_times(_RATE))
    prediction = Prediction(
        base.reduce(Regressor(subject).matrix(q, v, a)), printed.torque.noise_level, torque_weight
    )
    return nearest_consistent(
        base,
        table.mean,
        np.diag(table.standard_deviation**2),
        bounds or load_bounds(printed.name),
        prediction=prediction,
    )
