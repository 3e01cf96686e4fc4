"""The law along a surface on Drake's own plant: the outputs obey the linear dynamics of its poles.

As the test along a path, with the tangential coordinates (4.15) integrated together with the plant,
because they are an integral along the way and no function of the place.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator
from tests.control.law.closed_loop import (
    FEW_STEPS,
    ClosedLoop,
    assert_linear_dynamics,
    rest_of_state,
    simulate,
)
from tests.control.manifolds.surfaces import frame, further_coordinates, project

# seen from above, the tool looks down on it
DOWN = np.diag([1.0, -1.0, -1.0])
TILT = zyx_to_matrix([0.3, -0.2, 0.15])
SLOPE = zyx_to_matrix([0.0, 0.1, 0.1])
SURFACES = {
    "dome": (paraboloid(((-0.4, 0.4), (-0.4, 0.4)), -0.9, [0.9, 0.05, 0.8], TILT), (-0.1, 0.07)),
    "pipe": (
        cylinder(0.3, (-0.4, 0.4), Turned([0.9, 0.0, 0.5], zyx_to_matrix([0.2, 1.4, 0.1]))),
        (3.3, 0.04),
    ),
    "small dome": (
        paraboloid(((-0.3, 0.3), (-0.3, 0.3)), -0.9, [0.45, 0.05, 0.4], SLOPE),
        (0.03, 0.05),
    ),
}
ORIENTATIONS = {
    "normal": {"orientation": "normal", "offset": DOWN},
    "axis": {"orientation": "normal", "offset": DOWN, "tool_axis": [0.0, 0.0, 1.0]},
    "none": {},
}
SIX, THREE, SEVEN = "comau_racer_1_4", "comau_racer_1_4{}_3r", "franka_emika_panda"


class SurfaceLoop(ClosedLoop):
    """A robot under a law along a surface; the last two state variables are eta."""

    def __init__(self, robot, geometry, law, theta):
        self.prepare(robot, law)
        # the small arm is weak
        self.scale = 0.3 if robot.n == 7 else 1.0
        self._project = SurfaceEvaluator(geometry, self.r)
        self._theta = theta

    def reference(self, t):
        """Return derivatives 0..r of the outputs' reference, one row each; all of them move."""
        i, orders = np.arange(self.m), np.arange(self.r + 1)[:, None]
        amplitude = self.scale * np.array([0.06, 0.05, 0.004, 0.05, 0.04, 0.06])[: self.m]
        omega = 4.0 + i
        return amplitude * omega**orders * np.sin(omega * t + 0.4 * i + orders * np.pi / 2)

    def point(self, x):
        y_t = self.robot.tool_pose(self.state(x[:-2]))[0]
        point = self._project(y_t.tolist(), self._theta, (0.0, 0.0))
        self._theta = point[:2].tolist()
        point[self._project.layout.eta] = x[-2:]
        return point

    def evaluate(self, t, x):
        return self.result(t, x[:-2], self.point(x))

    def rates(self, t, x):
        result = self.evaluate(t, x)
        along = self.law.layout.virtual_input if self.r == 1 else self.law.layout.manifold_state
        begin = along.start + (0 if self.r == 1 else self.m)
        rates = self.plant_rates(t, x[:-2], result[self.law.layout.drive])
        return np.append(rates, result[begin : begin + 2])


CASES = [
    (law, model, orientation, "dome")
    for law in RELATIVE_DEGREE
    if law != "singular_perturbation"
    for model, orientation in ((SIX, "normal"), (SIX, "axis"), (THREE, "none"))
]
CASES += [
    ("rigid", SIX, "normal", "pipe"),
    ("elastic", SIX, "normal", "pipe"),
    ("rigid", SEVEN, "normal", "small dome"),
    ("visco_elastic", SEVEN, "axis", "small dome"),
    ("elastic", SEVEN, "normal", "small dome"),
]


@pytest.mark.slow(but="velocity_servo-comau_racer_1_4-normal-dome")
@pytest.mark.parametrize(("law", "model", "orientation", "name"), CASES)
def test_outputs_obey_the_predicted_linear_dynamics(
    law, model, orientation, name, load_robot, make_law
):
    r, (geometry, theta) = RELATIVE_DEGREE[law], SURFACES[name]
    stiff = model.format("") if model == THREE else model
    soft = model.format("_elastic") if model == THREE else f"{model}_elastic"
    rigid, robot = load_robot(stiff), load_robot(soft if r > 2 else stiff)
    if law == "visco_elastic":
        robot = load_robot(soft, tuple(2e-3 * robot.chain.K_s))
    manifold = SurfaceManifold(r, **ORIENTATIONS[orientation])
    made = make_law(robot.chain, law, manifold=manifold)
    loop = SurfaceLoop(robot, geometry, made, theta)

    sigma, _, axes = frame(geometry, theta)
    errors = Rotation.from_euler("ZYX", 0.4 * np.array([0.05, -0.04, 0.06])).as_matrix()
    R_e = axes @ DOWN @ errors if manifold.offset is not None else None
    q = robot.reach(sigma + axes @ [0.002, -0.003, 0.009 * loop.scale], R_e)
    loop.middle = q + 0.05
    x = np.append(rest_of_state(robot, rigid, q, loop.size), loop.scale * np.array([0.01, -0.012]))
    times, states = simulate(loop, x, FEW_STEPS)

    results = [loop.evaluate(t, x) for t, x in zip(times, states, strict=True)]
    assert not any(result[made.layout.status][0] for result in results)
    Y = np.array([result[made.layout.manifold_state] for result in results])
    Y = Y.reshape(len(times), loop.r, loop.m)
    v = np.array([result[made.layout.virtual_input] for result in results])

    further = []
    for x in states:
        y_t, R_e = robot.tool_pose(loop.state(x[:-2]))
        theta = project(geometry, y_t, theta)
        further.append(further_coordinates(manifold, geometry, theta, y_t, R_e))
    outputs = np.column_stack([states[:, -2:], further])
    assert_linear_dynamics(Y, v, outputs, np.array([loop.reference(t) for t in times]))
