"""Manifolds with two tangential coordinates: references that run with time, gains, and rest."""

import numpy as np
import pytest

from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.stabilization import LoopGains, Stabilization, gains_from_poles
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.controller.law_warnings import _transversal_gains
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator
from tests.control.manifolds.surfaces import SITUATIONS, frame, surface

DOWN = np.diag([1.0, -1.0, -1.0])


class MovingOnPlane:
    """A point that moves with time in the plane z = 1 m, the errors from it as coordinates."""

    name, follows_time = "plane", True
    coordinates = (
        Coordinate("x", Kind.TANGENTIAL, "f_x"),
        Coordinate("y", Kind.TANGENTIAL, "f_y"),
        Coordinate("z", Kind.TRANSVERSAL, "f_z"),
    )

    def __init__(self, order):
        self.layout = PathPointLayout(order, False)

    def virtual_output(self, y, R_e, point, lead):
        return [y[0] - lead[0], y[1] - lead[1], y[2] - 1.0]


@pytest.mark.parametrize("law", ["velocity_servo", "rigid"])
def test_both_references_run_with_time(law, load_robot, make_law):
    robot, r = load_robot("comau_racer_1_4_3r"), RELATIVE_DEGREE[law]
    made = make_law(robot.chain, law, manifold=MovingOnPlane(r))
    q, v = np.array([0.2, 1.6, -0.5]), np.array([0.1, -0.2, 0.3])
    state, rng = np.concatenate([q, v, q, v]), np.random.default_rng(2)
    reference = rng.uniform(-0.5, 0.5, (r + 1, 3))
    point = np.zeros(made.linearization.manifold.layout.size)
    result = made.evaluate(state, point, reference.ravel(), np.zeros(3))
    y_t = robot.tool_pose(state)[0]
    Y = result[made.layout.manifold_state].reshape(r, 3)
    assert np.allclose(Y[0], [*(y_t[:2] - reference[0, :2]), y_t[2] - 1.0], atol=1e-12)
    if r == 2:
        velocity = robot.jacobian(q)[3:] @ v
        assert np.allclose(Y[1], velocity - [*reference[1, :2], 0.0], atol=1e-12)
        return
    # servos move the tool with the references, and as the errors ask for
    velocity = robot.jacobian(q)[3:] @ result[made.layout.drive]
    poles = np.array([-20.0, -23.0, -26.0])
    assert np.allclose(velocity, poles * Y[0] + [*reference[1, :2], 0.0], atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["rigid", "elastic"])
def test_a_loop_at_rest_on_a_surface_has_the_poles_of_its_gains(law, load_robot):
    r, period, (theta, _) = RELATIVE_DEGREE[law], 2e-5, SITUATIONS["paraboloid"]
    rigid = load_robot("comau_racer_1_4")
    robot = rigid if r == 2 else load_robot("comau_racer_1_4_elastic")
    sigma, _, axes = frame(surface("paraboloid"), theta)
    q = rigid.reach(sigma, axes @ DOWN)
    manifold = SurfaceManifold(r, orientation="normal", offset=DOWN)
    linearization = linearize(robot.chain, law, manifold, ActuationOptions(period))
    poles = [[-10.0 - 4.0 * i - 30.0 * k for k in range(r)] for i in range(6)]
    names = [coordinate.name for coordinate in manifold.coordinates]
    gains = Stabilization([gains_from_poles(p) for p in poles], r, names)
    rest = RestPosture(q, SurfaceEvaluator(surface("paraboloid"), r).evaluate_at(theta))
    loop = LoopAtRest(robot.chain, linearization, rest, period)
    values = np.linalg.eigvals(loop.closed_loop(LoopGains(gains, None)))
    # besides them: sums of errors, which no gain listens to, and held inputs
    values = values[(np.abs(values) > 0.5) & (np.abs(values - 1.0) > 1e-9)]
    rates = np.sort((np.log(values) / period).real)
    assert np.allclose(rates, np.sort(np.ravel(poles)), rtol=0.05)


def test_tangential_gains_stand_back_for_the_transversal_ones(load_robot, make_law):
    law = make_law(load_robot("comau_racer_1_4").chain, "rigid", manifold=SurfaceManifold(2))
    gains = _transversal_gains(law)
    own = law.stabilization.proportional
    assert np.array_equal(gains, np.tile(own[:, 2:], 3))
    assert not np.array_equal(own, gains)
