"""One thing is wrong with a robot at rest, and it is said which."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm
from pydrake.multibody.tree import JacobianWrtVariable

from diagrams.robots.model import read_robot, tool_frame
from diagrams.scenario import RobotParameters
from experiments.hardware.check import listen
from experiments.hardware.statics import check_statics
from experiments.scenario_file import find_scenario
from pfsc_drake.drivers.link import ControllerEndpoint, RobotEndpoint
from pfsc_drake.drivers.messages import RobotStatus, dialect
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

Q = np.deg2rad([20.0, -30.0, 25.0, -110.0, 15.0, 80.0, 40.0])
RANDOM = np.random.default_rng(1)


def check_at_rest(robot, told):
    return check_statics(robot, told.q[None], told.torque[None])


def read(**keys):
    parameters = RobotParameters("franka_emika_panda", tool_frame="tool_point", **keys)
    plant = read_robot(parameters, find_scenario("pfc_panda_7r").parent)[0]
    return plant, tool_frame(plant, parameters)


@pytest.fixture(scope="module")
def panda():
    """The robot as Drake has it, as it is believed, and its coordinates."""
    plant, tool = read()
    return plant, *chain_from_plant(plant, tool)


def status(panda, tool=0.0, plant=None):
    """Return what a robot measures at rest by Drake's own gravity, with noise."""
    own, _, coordinates = panda
    plant, still = plant or own, np.zeros(7)
    context = plant.CreateDefaultContext()
    state = coordinates.plant_state(np.concatenate([Q, still, Q, still]))
    plant.SetPositionsAndVelocities(context, state)
    torque = -plant.CalcGravityGeneralizedForces(context)
    J = plant.CalcJacobianTranslationalVelocity(
        context,
        JacobianWrtVariable.kV,
        plant.GetFrameByName("tool_point"),
        np.zeros(3),
        plant.world_frame(),
        plant.world_frame(),
    )
    torque = torque + J.T @ np.array([0.0, 0.0, 9.81 * tool])
    return RobotStatus(0, Q, still, torque + 0.02 * RANDOM.normal(size=7))


def test_a_robot_as_it_is_believed(panda):
    found = check_at_rest(panda[1], status(panda))
    assert found.is_good
    assert found.verdict == "the robot's torques at rest agree with the model"


@pytest.mark.parametrize("joint", [1, 3])
def test_a_sign(panda, joint):
    told = status(panda)
    torque = np.where(np.arange(7) == joint, -told.torque, told.torque)
    found = check_at_rest(panda[1], replace(told, torque=torque))
    assert found.verdict.startswith(
        f"most likely the torque of joint {joint + 1} has the wrong sign"
    )


@pytest.mark.parametrize(("joint", "off"), [(1, 2.0), (3, -8.0)])
def test_a_zero(panda, joint, off):
    """The robot tells a joint elsewhere than it is."""
    told = status(panda)
    q = Q + np.deg2rad(off) * (np.arange(7) == joint)
    found = check_at_rest(panda[1], replace(told, q=q))
    (words,) = [c.words for c in found.causes if f"zero of joint {joint + 1} " in c.words]
    assert float(words.split()[-2]) == pytest.approx(off, abs=0.3)
    assert words in found.verdict


def test_a_payload(panda):
    found = check_at_rest(panda[1], status(panda, tool=1.0))
    assert "most likely the tool weighs 1.0" in found.verdict
    assert "kg more than in the model" in found.verdict
    found = check_at_rest(panda[1], status(panda, tool=-0.5))
    assert "most likely the tool weighs 0.5" in found.verdict
    assert "kg less than in the model" in found.verdict


def test_gravity_from_another_side(panda):
    wrong = read(gravity=[6.0, -4.0, -6.6])[0]
    found = check_at_rest(panda[1], status(panda, plant=wrong))
    assert found.verdict.startswith("most likely gravity is [")
    numbers = found.causes[0].words.split("[")[1].split("]")[0]
    np.testing.assert_allclose(np.array(numbers.split(","), float), [6.0, -4.0, -6.6], atol=0.2)


def test_what_no_single_cause_explains(panda):
    told = status(panda)
    found = check_at_rest(panda[1], replace(told, torque=told.torque + RANDOM.normal(size=7) * 8.0))
    assert "no single cause explains" in found.verdict


def test_what_is_listened_to(panda):
    lcm, spoken = DrakeLcm("memq://"), dialect("panda")
    robot, end = RobotEndpoint(lcm, spoken), ControllerEndpoint(lcm, spoken)
    with pytest.raises(InputError, match="no status of a robot on PANDA_STATUS"):
        listen(end, 1.0)
    robot.send_status(replace(status(panda), v=np.full(7, 0.1)))
    with pytest.raises(InputError, match="the robot moves at"):
        listen(end, 0.5)
    for bad in (np.nan, np.inf):
        robot.send_status(replace(status(panda), v=np.array([0.0, bad, 0.0, 0.0, 0.0, 0.0, 0.0])))
        with pytest.raises(InputError, match="the robot moves at"):
            listen(end, 0.5)
    with pytest.raises(InputError, match="the robot has 6 joints; the scenario's has 7"):
        check_at_rest(panda[1], RobotStatus(0, *np.zeros((3, 6))))


class Told:
    """A link on which one status after another waits."""

    dialect = dialect("panda")

    def __init__(self, *told):
        self._told = list(told)

    def receive(self, timeout):
        return self._told.pop(0) if self._told else None


def test_noise_is_averaged_over_half_a_second():
    states = [RobotStatus(k, *np.full((3, 7), 1e-3 * k)) for k in range(8)]
    found = listen(Told(*states), 0.1)
    assert found.utime == 4
    for values in (found.q, found.v, found.torque):
        np.testing.assert_allclose(values, np.full(7, 2e-3))
