"""Every row of Tab. 5.1 and 5.2: guidance fixtures, led by a hand that also pulls the tool off.

What is looked at is the true place of the tool in the world. How far a fixture may give follows
from circle and paraboloid in closed form, from the impedance of Tab. 4.3 integrated by scipy,
and without a sensor from the mass that Drake says the arm has.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from scipy.signal import lsim

from diagrams.builder import build_station
from diagrams.robots.model import read_robot, tool_frame
from diagrams.scenario import RobotParameters, Scenario
from experiments.scenario_file import read_scenario
from pfsc_drake.yaml.typed import load_typed

pytestmark = pytest.mark.slow

BEGIN, PULLED = 0.12, 0.28  # s
# s, when what lags has settled: servos take longer (15 1/s, Tab. 5.3), as does the arm's own mass
SETTLED = {("sensor", "dynamic law"): 0.38, ("sensor", "kinematic law"): 0.5}
SETTLED["back-drivable", "dynamic law"] = 0.5
CENTER, RADIUS = np.array([0.83, 0.0, 0.9]), 0.15  # (5.3)
APEX, COEFFICIENT = np.array([0.83, 0.0, 0.6]), 12.5  # (4.53)
IMPEDANCE = [3.0, 150.0, 5000.0], [1.0]  # Tab. 4.3: mass, damping, stiffness
SMALL_GAINS = [1.0, 24.0, 250.0], [1.0]  # of the scenarios without sensor: 1, a_2, a_1
HIGH_GAINS = [1.0, 78.0, 2028.0, 17576.0], [1.0, 0.0]  # Tab. 4.2, with an integral part
AMPLITUDE, FREQUENCY, RAMP = 0.01, 0.5, 0.2  # of fixtures that move: m, Hz, s

SCENARIOS = {
    ("sensor", "path"): "vf_soft_circle",
    ("sensor", "surface"): "sfc_comau_paraboloid",
    ("back-drivable", "path"): "vf_backdrivable_circle",
    ("back-drivable", "surface"): "vf_backdrivable_paraboloid",
}
HARD = {
    "sensor": (
        "compliance.transversal.stiffness.value=.inf",
        "compliance.rotational.stiffness.value=.inf",
    ),
    "back-drivable": (
        "controller.gains.rigid.xi.coefficients=[2028, 78]",
        "controller.gains.rigid.xi.integral=17576",
    ),
}
# Tab. C.3, as in the scenarios, which look it up in a long file
FRICTION = (
    "friction={f_c: [41.63, 101.7, 21.0, 4.194, 2.688, 3.746], "
    "f_v: [14.68, 97.29, 39.69, 1.812, 1.695, 1.102]}"
)
KINEMATIC = ("controller.law=velocity_servo",)
STARTS = {"path": [CENTER[0] + RADIUS, 0.0, CENTER[2]], "surface": APEX}
# from the start: along, and off
TARGETS = {"path": [0.0, 0.08, -0.08], "surface": [0.05, 0.0, 0.06]}
ALONG = {"path": 1, "surface": 0}  # axis of the world along the fixture at the start
SWUNG = {"path": 2, "surface": 1}


class Motion(NamedTuple):
    """What a run showed, with k transversal coordinates.

    Attributes:
        t: Times [s], shape (samples,).
        y_t: True places of the tool [m], shape (samples, 3).
        force: Of the hand, world axes [N], shape (samples, 3).
        xi: True deviation [m], shape (samples, k).
        pull: The hand's force across, shape (samples, k) [N].
        light: Acceleration across that the hand gives the mass of the arm, shape (samples, k)
            [m/s^2].
    """

    t: np.ndarray
    y_t: np.ndarray
    force: np.ndarray
    xi: np.ndarray
    pull: np.ndarray
    light: np.ndarray


@pytest.fixture(name="arm", scope="module")
def fixture_arm():
    """The true robot as Drake knows it."""
    parameters = RobotParameters("comau_racer_1_4")
    plant = read_robot(parameters, Path())[0]
    tool = tool_frame(plant, parameters)
    return plant, tool, plant.CreateDefaultContext()


def from_circle(y_t):
    """Return height and radial distance from the circle, and these directions, shape (2, 3)."""
    x, y, z = y_t - CENTER
    radius = np.hypot(x, y)
    return [z, radius - RADIUS], np.array([[0, 0, 1], [x / radius, y / radius, 0]])


def from_paraboloid(y_t):
    """Return the distance above the paraboloid, and the normal at the nearest point, (1, 3)."""
    x, y, z = y_t - APEX
    rho = np.hypot(x, y)
    # (s - rho) + (c s^2 - z) 2 c s = 0
    roots = np.roots([2.0 * COEFFICIENT**2, 0.0, 1.0 - 2.0 * COEFFICIENT * z, -rho])
    s = roots[np.abs(roots.imag) < 1e-9].real
    s = s[np.argmin((s - rho) ** 2 + (COEFFICIENT * s**2 - z) ** 2)]
    slope = 2.0 * COEFFICIENT * s
    along = np.array([x, y]) / rho if rho > 1e-9 else np.zeros(2)
    normal = np.array([*(-slope * along), 1.0]) / np.hypot(1.0, slope)
    foot = np.array([*(s * along), COEFFICIENT * s**2])
    return [normal @ (np.array([x, y, z]) - foot)], normal[None]


def run(arm, scenario, kind, places, changes, duration):
    waypoints = ", ".join(
        f"{{time: {t}, position: {np.add(STARTS[kind], place).tolist()}}}"
        for t, place in [(BEGIN, [0.0, 0.0, 0.0]), *places]
    )
    hand = ["hand.frame=world", f"hand.waypoints=[{waypoints}]", "hand.rotational_stiffness=0"]
    changes = [*hand, "start.transition=0.05", *changes]
    file = read_scenario(scenario, changes)
    settings = load_typed(Scenario, file.data, str(file.path))
    station = build_station(settings, file.path.parent)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(duration)
    assert station.fault(root) is None
    t, log = station.log.read(root)
    return told(arm, kind, t, log["joint_state"][:, :6], log["wrench_ext"])


def told(arm, kind, t, q, wrench):
    plant, tool, context = arm
    world, rows = plant.world_frame(), []
    for q_k, w_k in zip(q, wrench, strict=True):
        plant.SetPositions(context, q_k)
        y_t = tool.CalcPoseInWorld(context).translation()
        J = plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, tool, [0, 0, 0], world, world
        )
        torque = J.T @ np.concatenate([w_k[3:], w_k[:3]])
        xi, directions = from_circle(y_t) if kind == "path" else from_paraboloid(y_t)
        acceleration = J[3:] @ np.linalg.solve(plant.CalcMassMatrix(context), torque)
        rows.append((y_t, w_k[:3], xi, directions @ w_k[:3], directions @ acceleration))
    return Motion(t, *(np.array(column) for column in zip(*rows, strict=True)))


def swing(t, kind, is_dynamic):
    """Return where the fixture is along its own normals, shape (samples, k) [m]."""
    moved = np.zeros((len(t), 2 if kind == "path" else 1))
    if is_dynamic:
        since = t - BEGIN
        moved[:, -1] = AMPLITUDE * np.sin(2.0 * np.pi * FREQUENCY * since) * (since > 0.0)
    return moved


def yielding(t, dynamics, force):
    """Return what a force on a linear system moves from rest, shape (samples, k)."""
    system = dynamics[::-1]
    return np.array([lsim(system, column, t)[1] for column in force.T]).T


# the 16 rows of Tab. 5.1, and the 8 of Tab. 5.2
@pytest.mark.parametrize("kind", ["path", "surface"])
@pytest.mark.parametrize("level", ["hard", "soft"])
@pytest.mark.parametrize("moves", ["static", "dynamic"])
@pytest.mark.parametrize(("robot", "law"), SETTLED)
def test_row(arm, robot, moves, level, kind, law):
    changes = [*(HARD[robot] if level == "hard" else ())]
    changes += KINEMATIC if law == "kinematic law" else ()
    if moves == "dynamic":
        numbers = f"amplitude: {AMPLITUDE}, frequency: {FREQUENCY}, begin: {BEGIN}, ramp: {RAMP}"
        changes.append(f"reference.swings=[{{coordinate: {SWUNG[kind]}, {numbers}}}]")
    if robot == "sensor":
        changes.append(FRICTION)
    else:
        # what it believes wrongly weighs as the hand does
        changes += ["model_error={}", "friction={}"]
    motion = run(
        arm,
        SCENARIOS[robot, kind],
        kind,
        [(PULLED, TARGETS[kind])],
        changes,
        SETTLED[robot, law] + 0.03,
    )
    t, settled = motion.t, motion.t > SETTLED[robot, law]
    off = motion.xi - swing(t, kind, moves == "dynamic")
    assert np.ptp(motion.y_t[:, ALONG[kind]]) > 5e-3
    assert np.linalg.norm(motion.pull, axis=1).max() > 12.0
    if robot == "back-drivable":
        given = yielding(t, SMALL_GAINS if level == "soft" else HIGH_GAINS, motion.light)
    else:
        given = yielding(t, IMPEDANCE, motion.pull) * (level == "soft")
    if level == "hard":
        assert np.abs(off[settled]).max() < 2e-3
    else:
        assert np.abs(given).max() > 3e-3
    assert np.abs(off - given)[settled].max() < 0.5e-3


def test_a_spring_that_stiffens(arm):
    """At rest the force is k(xi) xi, the cubic from 2 to 12 N/mm within 10 mm (Sec. 5.1.2)."""
    spring = "{over: xi, at: [0, 0.01], values: [2000, 12000]}"
    changes = [f"compliance.transversal.stiffness={spring}", "hand.tremor=0"]
    ends = [0.7, 1.2, 1.7]
    places = []
    for end, down in zip(ends, (-0.012, -0.03, -0.055), strict=True):
        places += [(round(end - 0.4, 2), [0.0, 0.0, down]), (end, [0.0, 0.0, down])]
    motion = run(arm, "vf_soft_circle", "path", places, changes, ends[-1])
    deflections = []
    for end in ends:
        resting = (motion.t > end - 0.2) & (motion.t < end)  # it sticks and slips
        xi, pull = -motion.xi[resting, 0].mean(), -motion.pull[resting, 0].mean()
        s = xi / 0.01
        assert pull == pytest.approx((2000.0 + 1e4 * (3.0 * s**2 - 2.0 * s**3)) * xi, rel=0.05)
        deflections.append(xi)
    assert deflections[0] < 4e-3
    assert deflections[-1] > 5e-3
