"""The law as a whole: faults, limits, the safe state, the hold."""

import numpy as np
import pytest

from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import CoordinateGains, Stabilization
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import ProjectionStatus

THETA = 0.6


@pytest.fixture(scope="module", name="rigid_3r")
def fixture_rigid_3r(load_robot):
    return load_robot("comau_racer_1_4_3r")


@pytest.fixture(scope="module", name="q")
def fixture_q(rigid_3r, position_path):
    sigma = position_path.position.derivatives(THETA, 0)[0]
    return rigid_3r.reach(sigma + np.array([0.004, -0.006, 0.005]))


class Tick:
    """The arguments of one evaluation."""

    def __init__(self, robot, path, law, q):
        n, r = robot.n, law.linearization.relative_degree
        v = np.array([0.1, -0.2, 0.15])
        self.law = law
        self.state = np.concatenate([q, v, q + 1e-4, v + 0.01])
        y_t, _ = robot.tool_pose(self.state)
        self.point = path.evaluator(r)(y_t.tolist(), THETA)
        self.reference = np.zeros((r + 1) * n)
        self.reference[0] = self.point[1]
        self.integral = np.zeros(n)

    def __call__(self, **arguments):
        state, point, reference, integral = (
            arguments.pop(name, getattr(self, name))
            for name in ("state", "point", "reference", "integral")
        )
        return self.law.evaluate(state, point, reference, integral, **arguments)

    def fault(self, **arguments):
        return Fault(int(self(**arguments)[self.law.layout.status][0]))

    def changed(self, name, index, value):
        """Return a copy of one argument with an entry changed."""
        array = getattr(self, name).copy()
        array[index] = value
        return {name: array}


@pytest.fixture(scope="module", name="tick")
def fixture_tick(rigid_3r, position_path, make_law, q):
    return Tick(rigid_3r, position_path, make_law(rigid_3r.chain, "rigid", False), q)


def test_good_input_has_no_fault(tick):
    result = tick()
    status = result[tick.law.layout.status]
    assert status[0] == Fault.NONE
    assert 0.0 < status[1] <= 1.0
    assert status[2] == 0.0
    assert np.all(np.isfinite(result))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_state_that_is_not_finite_is_a_fault(tick, bad):
    for index in range(12):  # of motors too, by whose velocities the safe state brakes
        assert tick.fault(**tick.changed("state", index, bad)) == Fault.INPUT_NOT_FINITE


def test_motor_state_that_is_not_finite_is_a_fault_where_it_is_used(load_robot, make_law, q, tick):
    robot = load_robot("comau_racer_1_4_elastic_3r")
    law = make_law(robot.chain, "elastic", False)
    point = np.zeros(law.linearization.manifold.layout.size)
    point[: tick.point.size] = tick.point
    for index in range(6, 12):
        state = tick.changed("state", index, np.nan)["state"]
        result = law.evaluate(state, point, np.zeros(15), np.zeros(3))
        assert result[law.layout.status][0] == Fault.INPUT_NOT_FINITE


@pytest.mark.parametrize("name", ["reference", "integral", "point"])
def test_nothing_else_that_is_not_finite_passes(tick, name):
    argument = getattr(tick, name)
    for index in range(len(argument)):
        result = tick(**tick.changed(name, index, np.nan))
        used = np.isnan(result[tick.law.layout.drive]).any()
        assert not used or result[tick.law.layout.status][0] != Fault.NONE, index


def test_the_projections_faults(tick):
    layout = tick.law.linearization.manifold.layout
    not_converged = tick.changed("point", layout.status.start, ProjectionStatus.NOT_CONVERGED)
    beyond = tick.changed("point", layout.status.start, ProjectionStatus.BEYOND_END)
    assert tick.fault(**not_converged) == Fault.PROJECTION_FAILED
    assert tick.fault(**beyond) == Fault.NONE
    for alpha, fault in ((0.899, Fault.NONE), (0.9, Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD)):
        assert tick.fault(**tick.changed("point", layout.alpha.start, alpha)) == fault
    # a projection of a tool that is nowhere: the state is the root cause
    nowhere = not_converged | tick.changed("state", 0, np.nan)
    assert tick.fault(**nowhere) == Fault.INPUT_NOT_FINITE


@pytest.mark.parametrize("beyond", [-0.031, -0.029, 0.029, 0.031])
def test_an_end_of_an_open_path(rigid_3r, position_path, make_law, tick, beyond):
    """Beyond it by more than a bound is a fault, before and behind; of a closed path nothing."""
    manifold = PathManifold(2, oriented=False, length=0.7)
    law = make_law(rigid_3r.chain, "rigid", False, manifold=manifold, max_beyond_end=0.03)
    here = Tick(rigid_3r, position_path, law, tick.state[:3])
    place = {"point": here.point.copy()}
    place["point"][manifold.layout.eta] = beyond if beyond < 0.0 else 0.7 + beyond
    far = abs(beyond) > 0.03
    assert here.fault(**place) == (Fault.BEYOND_END if far else Fault.NONE)
    assert tick.fault(**place) == Fault.NONE


def test_a_stretched_arm_is_singular(rigid_3r, position_path, make_law, tick):
    """Singular posture: both pivots and the tool point in line, within the joint limits."""
    law = make_law(rigid_3r.chain, "rigid", False, inverse=DecouplingInverse(1e-3))

    def smallest(angle):
        jacobian = rigid_3r.jacobian(np.array([0.1, 1.2, angle]))[3:]
        return np.linalg.svd(jacobian, compute_uv=False)[-1]

    angles = np.linspace(-2.5, -0.5, 2001)
    sizes = [smallest(angle) for angle in angles]
    stretched = angles[int(np.argmin(sizes))]
    assert min(sizes) < 1e-3
    for angle, fault in ((stretched, Fault.SINGULAR), (stretched - 0.5, Fault.NONE)):
        here = Tick(rigid_3r, position_path, law, np.array([0.1, 1.2, angle]))
        # the path's point stays a good one, only the arm is stretched
        assert here.fault(point=tick.point) == fault


def test_every_fault_is_explained():
    assert len({fault.explanation for fault in Fault}) == len(Fault)


def test_the_drives_are_limited_and_counted(rigid_3r, position_path, make_law, q, tick):
    wanted = tick()[tick.law.layout.drive]
    limits = np.abs(wanted) * [0.5, 1.5, 0.9]
    law = make_law(rigid_3r.chain, "rigid", False, limits=limits)
    result = Tick(rigid_3r, position_path, law, q)()
    expected = wanted * [0.5, 1.0, 0.9]
    assert np.allclose(result[law.layout.drive], expected, rtol=1e-12)
    assert result[law.layout.status].tolist()[::2] == [Fault.NONE, 2.0]


def test_results_are_new_arrays(tick):
    first = tick()
    before = first.copy()
    tick(**tick.changed("state", 0, 0.3))
    assert np.array_equal(first, before)
    # nor does anything remain from one evaluation to the next
    assert np.array_equal(tick(), before)
    tick(tau_ext=np.ones(3))
    assert np.array_equal(tick(), before)


def test_manifold_state_and_virtual_input(tick, virtual_output, rigid_3r, position_path):
    layout, law = tick.law.layout, tick.law
    result = tick()
    y_t, R_e = rigid_3r.tool_pose(tick.state)
    Y = result[layout.manifold_state].reshape(2, 3)
    assert np.allclose(Y[0], virtual_output(position_path, y_t, R_e), rtol=0, atol=1e-12)
    error = Y - tick.reference.reshape(3, 3)[:2]
    expected = -np.sum(law.stabilization.proportional * error, axis=0)
    assert np.allclose(result[layout.virtual_input], expected, rtol=0, atol=1e-9)


def test_integral_part_acts(rigid_3r, position_path, make_law, q):
    law = make_law(rigid_3r.chain, "rigid", False, integral=40.0)
    tick = Tick(rigid_3r, position_path, law, q)
    part = law.layout.virtual_input
    difference = tick(integral=np.array([1.0, -2.0, 3.0]))[part] - tick()[part]
    assert np.allclose(difference, [-40.0, 80.0, -120.0], rtol=1e-9)


@pytest.mark.parametrize(("sampling_time", "lead"), [(0.0, 0.0), (1e-3, 0.5)])
def test_half_a_tick_is_extrapolated(sampling_time, lead, load_robot, position_path, make_law, q):
    robot = load_robot("comau_racer_1_4_elastic_3r")
    law = make_law(robot.chain, "elastic", False, sampling_time=sampling_time)
    tick = Tick(robot, position_path, law, q)
    alone = tick()
    held, drive = alone[law.layout.varying_input], alone[law.layout.drive]
    change = np.array([3.0, -5.0, 7.0])
    result = tick(last_varying_input=held - change)
    assert np.allclose(result[law.layout.varying_input], held, rtol=1e-12)
    assert np.allclose(result[law.layout.drive], drive + lead * change, rtol=0, atol=1e-8)
    assert np.array_equal(tick(), alone)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("limits", np.ones(2), "drive limits.*3 positive"),
        ("limits", np.array([1.0, 0.0, 1.0]), "drive limits.*3 positive"),
        ("limits", np.array([1.0, np.nan, 1.0]), "drive limits.*3 positive"),
        ("max_alpha", 1.0, "max_alpha: 1.0"),
        ("max_alpha", 0.0, "max_alpha: 0.0"),
        ("max_alpha", np.nan, "max_alpha: nan"),
        ("safe_state", SafeState(np.ones(2)), "safe state damping.*3"),
        ("safe_state", SafeState(np.array([1.0, -1.0, 1.0])), "safe state damping.*3"),
        (
            "stabilization",
            Stabilization([CoordinateGains((1.0,))] * 3, 1, ["eta", "xi_1", "xi_2"]),
            "gains of relative degree 1 for a law of relative degree 2",
        ),
        (
            "stabilization",
            Stabilization([CoordinateGains((1.0, 2.0))] * 2, 2, ["eta", "xi_1"]),
            "gains of 2 coordinates.*3",
        ),
    ],
)
def test_wrong_arguments_are_refused(name, value, message, rigid_3r, make_law):
    with pytest.raises(InputError, match=message):
        make_law(rigid_3r.chain, "rigid", False, **{name: value})
