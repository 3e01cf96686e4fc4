"""The reference point that moves with time."""

import numpy as np

from pfsc_drake.control.manifolds.moving_point import TrajectoryPoint
from pfsc_drake.geometry import FourierCurve, Path
from pfsc_drake.systems.block_system import BlockSystem


def test_it_is_where_the_reference_says():
    path = Path(FourierCurve.bent_lemniscate())
    block = TrajectoryPoint(path, relative_degree=2, num_outputs=3)
    system = BlockSystem(block, 1e-3)
    context = system.CreateDefaultContext()
    reference = np.zeros(9)
    reference[0] = 0.7
    system.GetInputPort("reference").FixValue(context, reference)
    point = system.GetOutputPort("manifold_point").Eval(context)
    position, _ = path.pose(0.7)
    assert np.allclose(point[block.layout.position][:3], position, atol=1e-12)
    assert np.isclose(point[block.layout.eta][0], 0.7, atol=1e-10)
    assert point[block.layout.alpha][0] == 0.0
