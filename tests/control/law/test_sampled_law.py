"""The law from tick to tick, without Drake: what it remembers, and when it does not."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.exact_linearization import ExactLinearization, Relation
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.rest_hold import RestHold
from pfsc_drake.control.law.sampled_law import LawReport, SampledLaw
from pfsc_drake.control.manifolds.moving_frame import MovingFrameManifold
from pfsc_drake.control.manifolds.path import PathManifold

PERIOD, THETA = 1e-3, 0.6


class Loop:
    """A law and its inputs: joints beside a path, at rest in space."""

    def __init__(self, robot, path, law):
        self.law, n, r = law, robot.n, law.linearization.relative_degree
        sigma = path.position.derivatives(THETA, 0)[0]
        q = robot.reach(sigma + np.array([0.004, -0.006, 0.005]))
        v = np.array([0.1, -0.2, 0.15])
        self.state = np.concatenate([q, v, q, v])
        y_t, _ = robot.tool_pose(self.state)
        self.point = path.evaluator(r)(y_t.tolist(), THETA)
        self.reference = np.zeros((r + 1) * n)
        self.reference[0] = self.point[1] + 0.01
        self.linear = Stepper(ExactLinearization(law.linearization))
        self.sampled = Stepper(SampledLaw(law, PERIOD))

    def tick(self, stopping=0.0, **changes):
        told = {"joint_state": self.state, "manifold_point": self.point} | changes
        relation = self.linear.step(**{k: told[k] for k in ("joint_state", "manifold_point")})
        told = {"reference": self.reference, "stopping": stopping} | relation | told
        return self.sampled.step(**told)


@pytest.fixture(name="loop", params=[False, True])
def fixture_loop(request, load_robot, position_path, make_law):
    robot = load_robot("comau_racer_1_4_3r")
    law = make_law(robot.chain, "rigid", False, integral=40.0, has_reference_velocity=request.param)
    return Loop(robot, position_path, law)


def test_a_relation_has_the_parts_of_the_linearization(loop):
    results = loop.law.linearization.function(loop.state, np.zeros(3), loop.point)
    inputs = Values(joint_state=ca.DM(loop.state), manifold_point=ca.DM(loop.point), tau_ext=None)
    # a block called with numbers calculates
    vector = ExactLinearization(loop.law.linearization).output(Values(), inputs, 0)["relation"]
    for name, expected in zip(Relation._fields, results, strict=True):
        found = getattr(Relation.of(vector, loop.law.linearization), name)
        np.testing.assert_array_equal(np.array(found), np.array(expected), err_msg=name)


def test_ticks_are_those_of_the_law_with_what_it_remembers(loop):
    layout, integral = loop.law.layout, np.zeros(3)
    held = output = None
    for _ in range(3):
        found = loop.tick()
        expected = loop.law.evaluate(
            loop.state, loop.point, loop.reference, integral, held, last_output=output
        )
        np.testing.assert_allclose(found["evaluation"], expected, rtol=1e-12, atol=1e-12)
        for name in ("manifold_state", "virtual_input"):
            part = found["evaluation"][getattr(layout, name)]
            np.testing.assert_allclose(found[name], part, rtol=1e-14)
        held, output = expected[layout.varying_input], found["manifold_state"][:3]
        integral = integral + PERIOD * (output - loop.reference[:3])


def test_after_a_fault_nothing_is_remembered(loop):
    loop.tick()
    before = loop.sampled.states
    loop.tick(stopping=4.0, joint_state=loop.state + 0.1)
    for name, value in before.items():
        np.testing.assert_array_equal(loop.sampled.states[name], value, err_msg=name)


@pytest.mark.parametrize("model", ["comau_racer_1_4_3r", "comau_racer_1_4_elastic_3r"])
def test_friction_is_added_to_what_drives_give(model, load_robot, position_path, make_law):
    """In the sample it comes in, and in full: nothing of it is extrapolated over the hold."""
    robot, friction = load_robot(model), np.array([12.0, -30.0, 7.0])
    law = make_law(robot.chain, "elastic" if robot.chain.is_elastic else "rigid", False)
    sigma = position_path.position.derivatives(THETA, 0)[0]
    q = load_robot("comau_racer_1_4_3r").reach(sigma)
    state, r = np.tile(np.append(q, [0.0] * 3), 2), law.linearization.relative_degree
    point = position_path.evaluator(r)(sigma.tolist(), THETA)
    reference = np.zeros((r + 1) * 3)
    reference[0] = point[1]
    told, drive = (state, point, reference, np.zeros(3)), law.layout.drive
    for held in (None, law.evaluate(*told)[law.layout.varying_input]):
        without = law.evaluate(*told, held)[drive]
        found = law.evaluate(*told, held, friction=friction)[drive]
        np.testing.assert_allclose(found - without, friction, rtol=1e-9)


def test_what_a_drive_cannot_do_is_not_integrated(loop):
    far = loop.reference + 1e7
    assert loop.tick(reference=far)["evaluation"][loop.law.layout.status][2] == 3.0
    np.testing.assert_array_equal(loop.sampled.states["integral"], np.zeros(3))
    loop.tick()
    assert loop.sampled.states["integral"].all()


def test_faults_of_inputs_are_told_apart(loop):
    for index, fault in ((1, Fault.INPUT_NOT_FINITE), (0, Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD)):
        changes = {"reference": np.full(9, np.nan)} if index else {}
        point = loop.point.copy()
        point[loop.law.linearization.manifold.layout.alpha] = 0.95
        found = loop.tick(stopping=1.0, manifold_point=point, **changes)
        assert found["fault"] == fault
        assert found["input_fault"] == (fault if index else Fault.NONE)


def test_the_reference_velocity_is_that_of_the_last_tick(loop):
    first = loop.tick()
    if "reference_velocity" not in first:
        pytest.skip("the law does not output it")
    assert not first["reference_velocity"].any()
    found = loop.tick()
    np.testing.assert_array_equal(
        found["reference_velocity"], found["evaluation"][loop.law.layout.reference_velocity]
    )


def test_a_report_has_the_fault_and_what_the_drives_were_told(loop):
    layout = loop.law.layout
    evaluation, told = np.arange(float(layout.size)), -np.ones(3)
    found = Stepper(LawReport(layout)).step(evaluation=evaluation, fault=7.0, command=told)
    expected = evaluation.copy()
    expected[layout.drive], expected[layout.status.start] = told, 7.0
    np.testing.assert_array_equal(found["law"], expected)
    np.testing.assert_array_equal(found["status"], expected[layout.status])


def test_drives_are_not_held_while_the_frame_moves(load_robot, position_path, make_law):
    robot = load_robot("comau_racer_1_4_3r")
    manifold = MovingFrameManifold(PathManifold(2, oriented=False))
    law = make_law(robot.chain, "rigid", False, manifold=manifold)
    hold = RestHold(np.array([4.0, 5.0, 3.0]), 1e-3, 0.02, 2e-4, settling=5, largest_error=np.inf)
    q = robot.reach(position_path.position.derivatives(THETA, 0)[0] + [0.004, -0.006, 0.005])
    state = np.concatenate([q, np.zeros(3), q, np.zeros(3)])
    place = position_path.evaluator(2)(robot.tool_pose(state)[0].tolist(), THETA)

    def drives(rate):
        """Return the drive torques of some ticks, with the frame at a rate [m/s]."""
        rows = np.zeros((3, 12))
        rows[0, 3:], rows[1, 1] = np.eye(3).ravel(), rate
        told = {"joint_state": state, "manifold_point": np.concatenate([place, rows.ravel()])}
        linear, sampled = (
            Stepper(ExactLinearization(law.linearization)),
            Stepper(SampledLaw(law, PERIOD, hold)),
        )
        reference, torques = np.zeros(9), []
        for k in range(25):
            reference[0] = place[1] + 1e-3 * k
            relation = linear.step(**told)
            result = sampled.step(reference=reference, stopping=0.0, **told, **relation)
            torques.append(result["evaluation"][law.layout.drive])
        return np.array(torques)

    # a reference that jumps moves torques, unless they are held
    assert np.ptp(drives(4e-3)[15:], axis=0).max() == 0.0
    assert np.ptp(drives(6e-3)[15:], axis=0).min() > 0.01
