"""Stopping and holding, on the equations of motion of a robot integrated here."""

import re

import casadi as ca
import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.safe_stop import SafeState, SafeStop, StopCategory
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

PERIOD, N = 1e-3, 3
POSTURE, SPEED = np.array([0.2, 1.4, -0.4]), np.array([0.8, -0.9, 1.2])
NOTHING = np.zeros(4 * N)


class Robot:
    """Three axes in Drake's plant; rigid ones, or links and motors with springs between."""

    def __init__(self, name: str, softer: float = 1.0) -> None:
        self.plant = MultibodyPlant(0.0)
        text = re.sub(
            r"(?<=<spring_stiffness>)[^<]+",
            lambda stiffness: str(float(stiffness[0]) / softer),
            resolve_model(name).read_text(),
        )
        Parser(self.plant).AddModelsFromString(text, "sdf")
        self.plant.Finalize()
        tool = self.plant.GetFrameByName("tool_point")
        self.chain, self.coordinates = chain_from_plant(self.plant, tool)
        self.rows = np.vstack([self.coordinates.link_rows, self.coordinates.motor_rows])
        self.limits = self.chain.gather("effort_limit")
        self.context = self.plant.CreateDefaultContext()
        port = self.plant.get_actuation_input_port()
        self.actuation = port.FixValue(self.context, np.zeros(N)).GetMutableData
        self.block = SafeStop(self.chain, self.limits, SafeState(np.zeros(N)), PERIOD)
        self.gravity = gravity_function(self.chain)

    def stop(self, last):
        """Return the safe stop of joints that were in a state at the last tick."""
        stepper = Stepper(self.block)
        tell(stepper, last, fault=0.0)
        return stepper

    def state(self, q, v):
        """Return the plant's state with springs under the weight."""
        weight = self.weight(q)
        x = np.concatenate([q, v, q + weight / self.chain.K_s, v])
        return self.coordinates.plant_state(x)

    def weight(self, q):
        return np.array(self.gravity(ca.DM(q))).ravel()

    def rates(self, x):
        self.plant.SetPositionsAndVelocities(self.context, x)
        return self.plant.EvalTimeDerivatives(self.context).CopyToVector()

    def step(self, x, tau):
        """Integrate over a period by the classical scheme of fourth order."""
        h, actuation = PERIOD, np.zeros(N)
        actuation[self.coordinates.actuators] = tau
        self.actuation().get_mutable_value().SetFromVector(actuation)
        k_1 = self.rates(x)
        k_2 = self.rates(x + h / 2 * k_1)
        k_3 = self.rates(x + h / 2 * k_2)
        k_4 = self.rates(x + h * k_3)
        return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def tell(stepper, measured, suspects=NOTHING, fault=1.0):
    """Return the drive torques of a tick, after a fault."""
    return stepper.step(joint_state=measured, fault=fault, suspects=suspects)["torque"]


@pytest.fixture(scope="module", params=["comau_racer_1_4_3r", "comau_racer_1_4_elastic_3r"])
def robot(request):
    return Robot(request.param)


def stop(robot, lost=(), suspect=(), ticks=700, spoil=np.nan, speed=SPEED, bias=0.0):
    """Stop a moving robot of which components are lost, and return states and torques."""
    x, suspects = robot.state(POSTURE, speed), NOTHING.copy()
    suspects[list(suspect)] = 1.0
    safe = robot.stop(robot.rows @ robot.step(x, robot.weight(POSTURE)))
    states, torques = [], []
    for _ in range(ticks):
        true = robot.rows @ x
        measured = true + bias
        measured[list(lost)] = spoil
        tau = tell(safe, measured, suspects)
        states.append(true)
        torques.append(tau)
        x = robot.step(x, tau)
    return np.array(states), np.array(torques)


def check(states, travel=0.12):
    """Check that a robot has stopped soon, and stays."""
    way = np.abs(states[:, :N] - states[0, :N]).max()
    assert way < travel
    rest = states[400:]
    assert np.abs(rest[:, :N] - rest[0, :N]).max() < np.deg2rad(0.5)
    assert np.abs(states[-50:, N : 2 * N]).max() < 5e-3


def test_it_stops_and_holds(robot):
    states, torques = stop(robot)
    check(states)
    assert np.all(np.abs(torques) <= robot.limits)
    # where it rests there is only the weight left, and no jump on the way there
    np.testing.assert_allclose(torques[-1], robot.weight(states[-1, :N]), atol=0.5)
    assert np.abs(np.diff(torques[5:], axis=0)).max() < 0.05 * robot.limits.max()


@pytest.mark.slow(
    but=[
        "comau_racer_1_4_3r-1",
        "comau_racer_1_4_3r-10",
        "comau_racer_1_4_elastic_3r-4",
        "comau_racer_1_4_elastic_3r-7",
    ]
)
@pytest.mark.parametrize("component", [1, 4, 7, 10])
def test_each_component_may_be_lost(robot, component):
    check(stop(robot, lost=[component])[0])


@pytest.mark.parametrize("component", [1, 4, 7, 10])
def test_what_is_implausible_is_not_used(robot, component):
    """The value is off by far, as the supervision has found."""
    check(stop(robot, lost=[component], suspect=[component], spoil=5.0)[0])


def test_the_link_side_may_be_lost(robot):
    check(stop(robot, lost=[1, N + 1])[0])


@pytest.mark.parametrize("left", [1, 2 * N + 1])
def test_one_position_of_a_rigid_joint_may_be_all_that_is_left(left):
    """Its rate is that position's, whichever side it is of; the other joint stops as planned."""
    robot = Robot("comau_racer_1_4_3r")
    every = [1, N + 1, 2 * N + 1, 3 * N + 1]
    states, torques = stop(robot, lost=[i for i in every if i != left])
    check(states)
    planned = stop(robot)[0]
    assert np.abs(states[:, N + 1] - planned[:, N + 1]).max() < 0.12
    assert np.abs(np.diff(torques[50:, 1])).max() < 0.05 * robot.limits[1]


def test_of_the_motor_side_nothing_may_be_left(robot):
    """A soft joint is then held by what its motor is thought to do: it creeps, by less than 5."""
    states, _ = stop(robot, lost=[2 * N + 1, 3 * N + 1])
    assert np.abs(states[:, :N] - states[0, :N]).max() < 0.15
    assert np.abs(states[400:, :N] - states[400, :N]).max() < np.deg2rad(5.0)


def test_a_joint_that_is_not_seen_gets_the_planned_torque(robot):
    """From rest: its weight, whatever the others do."""
    x = robot.rows @ robot.state(POSTURE, np.zeros(N))
    unseen, safe = x.copy(), robot.stop(x)
    unseen[1::N] = np.nan
    for _ in range(50):
        tau = tell(safe, unseen)
    assert tau[1] == pytest.approx(robot.weight(POSTURE)[1], abs=1e-9)


def test_a_value_that_comes_back_is_used_unless_it_was_implausible(robot):
    x = robot.rows @ robot.state(POSTURE, np.zeros(N))
    away = x.copy()
    away[2 * N :] += np.repeat([0.01, 0.0], N)
    lost = x.copy()
    lost[2 * N + 1] = np.nan
    pulls = []
    for suspects in (NOTHING, np.eye(4 * N)[2 * N + 1]):
        safe = robot.stop(x)
        tell(safe, lost, suspects)
        pulls.append(tell(safe, away)[1] - robot.weight(POSTURE)[1])
        np.testing.assert_array_equal(safe.states["ignored"], suspects)
    assert pulls[0] < -10.0
    assert pulls[0] < 0.1 * pulls[1] if pulls[1] < 0.0 else pulls[1] < 10.0


def test_fast_joints_are_given_the_time_that_their_drives_need(robot):
    """Three times the speed: the limits are respected, and the robot stands within a second."""
    states, torques = stop(robot, speed=2.5 * SPEED)
    check(states, travel=1.0)
    assert np.mean(np.abs(torques) >= robot.limits) < 0.01


def test_what_moves_up_stops_sooner_than_what_moves_down(robot):
    """The weight helps to brake the one, and takes of the drive's torque from the other."""
    x = robot.rows @ robot.state(POSTURE, np.zeros(N))
    up = np.zeros(N)
    up[1] = 4.0 * np.sign(robot.weight(POSTURE)[1])
    durations = []
    for speed in (up, -up):
        x[N : 2 * N] = x[3 * N :] = speed
        safe = robot.stop(x)
        tell(safe, x)
        durations.append(safe.states["duration"].item())
    sooner, later = durations
    weight, limit = abs(robot.weight(POSTURE)[1]), 0.7 * robot.limits[1]
    assert later / sooner == pytest.approx((limit + weight) / (limit - weight))


def test_braking_peaks_at_the_share_of_the_drive_that_it_was_planned_with(robot):
    """Axis 1, which carries no weight: momentum p in T takes 1.5 p / T at the steepest."""
    if np.isfinite(robot.chain.K_s).all():
        pytest.skip("the swing of elastic links adds to it")
    speed = np.array([2.0, 0.0, 0.0])
    _, torques = stop(robot, speed=speed, ticks=400)
    assert np.abs(torques[5:, 0]).max() == pytest.approx(0.7 * robot.limits[0], rel=0.1)


def test_nothing_jumps_where_motors_and_links_part(robot):
    """At the instant of the fault the drives get what the motion takes anyway, by Drake."""
    if np.isinf(robot.chain.K_s).all():
        pytest.skip("rigid joints do not part")
    x = robot.rows @ robot.state(POSTURE, SPEED)
    x[3 * N :] += [0.3, -0.2, 0.4]
    rigid = Robot("comau_racer_1_4_3r")
    rigid.plant.SetPositionsAndVelocities(
        rigid.context, rigid.coordinates.plant_state(np.tile([*POSTURE, *SPEED], 2))
    )
    forces = MultibodyForces(rigid.plant)
    rigid.plant.CalcForceElementsContribution(rigid.context, forces)
    borne = rigid.plant.CalcInverseDynamics(rigid.context, np.zeros(N), forces)
    torque = tell(robot.stop(x), x)
    np.testing.assert_allclose(torque, borne, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("lost", [1, 2 * N + 1])
def test_an_implausible_side_is_taken_from_the_other_and_the_weight_between(robot, lost):
    """A position of link or motor 2, long wrong: the spring reveals it."""
    true = robot.rows @ robot.state(POSTURE, np.zeros(N))
    wrong, suspects = true.copy(), NOTHING.copy()
    wrong[lost] += 0.5
    suspects[lost] = 1.0
    safe = robot.stop(wrong)
    tell(safe, wrong, suspects)
    found = safe.states["q_0" if lost < N else "position"][1]
    bend = abs(robot.weight(POSTURE)[1] / robot.chain.K_s[1])
    assert found == pytest.approx(true[lost], abs=1e-9 + 0.1 * bend)


def test_the_swing_of_soft_links_dies_out():
    """Motors that are all but clamped would let them swing on their springs."""
    states, _ = stop(Robot("comau_racer_1_4_elastic_3r", softer=30.0), ticks=1500)
    swing = np.abs(states[:, N : 2 * N] - states[:, 3 * N :]).max(axis=1)
    assert swing[:200].max() > 0.02
    assert swing[-100:].max() < 0.02 * swing[:200].max()


def test_a_motor_whose_position_is_lost_does_not_drift(robot):
    """Its velocity is measured 0.03 rad/s too high; what it integrates follows the link."""
    if np.isinf(robot.chain.K_s).all():
        pytest.skip("of rigid joints one side is the other")
    bias = np.zeros(4 * N)
    bias[3 * N + 1] = 0.03
    states, _ = stop(robot, lost=[2 * N + 1], bias=bias, ticks=1500)
    drift = abs(states[-1, 1] - states[1000, 1])
    assert drift < 1e-3


def categories(robot, has_brakes, lost_from, lost_until, ticks=400):
    """Return stop categories of a robot at rest, of whose joint 2 nothing is measured."""
    block = SafeStop(
        robot.chain, robot.limits, SafeState(np.zeros(N), has_brakes=has_brakes), PERIOD
    )
    stepper, measured = Stepper(block), robot.rows @ robot.state(POSTURE, np.zeros(N))
    found = [stepper.step(joint_state=measured, fault=0.0, suspects=NOTHING)]
    for k in range(ticks):
        told = measured.copy()
        if lost_from <= k < lost_until:
            told[[1, N + 1, 2 * N + 1, 3 * N + 1]] = np.nan
        found.append(stepper.step(joint_state=told, fault=3.0, suspects=NOTHING))
    return np.array([row["stop_category"] for row in found])


@pytest.mark.parametrize("has_brakes", [False, True])
def test_brakes_are_requested_where_nothing_holds_a_joint(robot, has_brakes):
    """After 50 ms, and for good; what comes back before is held again."""
    controlled = StopCategory.CONTROLLED if has_brakes else StopCategory.HOLD
    found = categories(robot, has_brakes, 20, 1000, ticks=120)
    # the count begins with the sample at which the joint is lost first
    expected = [StopCategory.NONE, *[controlled] * 70, *[StopCategory.BRAKES] * 50]
    assert found[:, 0].tolist() == expected
    found = categories(robot, has_brakes, 20, 69, ticks=120)
    assert set(found[1:, 0]) == {controlled}
    found = categories(robot, has_brakes, 20, 75, ticks=120)
    assert found[-1] == StopCategory.BRAKES


def test_brakes_follow_a_controlled_stop(robot):
    """From rest a stop takes 50 ms; brakes come 0.2 s later."""
    found = categories(robot, True, 0, 0)
    assert found[0] == StopCategory.NONE
    assert np.flatnonzero(found[:, 0] == StopCategory.CONTROLLED)[[0, -1]].tolist() == [1, 250]
    assert set(found[251:, 0]) == {StopCategory.BRAKES}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (SafeState(np.zeros(N), bandwidth=0.0), "bandwidth: 0.0"),
        (SafeState(np.zeros(N), effort_share=1.5), "effort share: 1.5"),
        (SafeState(np.full(N, np.nan)), "damping.*3 finite"),
    ],
)
def test_wrong_settings_are_refused(robot, settings, message):
    with pytest.raises(InputError, match=message):
        SafeStop(robot.chain, robot.limits, settings, PERIOD)
