"""The reference point that moves with time."""

import numpy as np

from pfsc_drake.geometry import FourierCurve, Path
from pfsc_drake.systems.control.trajectory_point import TrajectoryPoint


def test_it_is_where_the_reference_says():
    path = Path(FourierCurve.bent_lemniscate())
    system = TrajectoryPoint(path, relative_degree=2, num_outputs=3)
    context = system.CreateDefaultContext()
    reference = np.zeros(9)
    reference[0] = 0.7
    system.GetInputPort("reference").FixValue(context, reference)
    point = system.GetOutputPort("manifold_point").Eval(context)
    position, _ = path.pose(0.7)
    assert np.allclose(point[system.layout.position][:3], position, atol=1e-12)
    assert np.isclose(point[system.layout.eta][0], 0.7, atol=1e-10)
    assert point[system.layout.alpha][0] == 0.0
