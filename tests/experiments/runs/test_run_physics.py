"""Whether what a run logs is physics: by Drake's rigid links, Newton's law and linear dynamics."""

import math

import numpy as np
import pytest
import yaml
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.linalg import expm
from scipy.optimize import newton
from scipy.spatial.transform import Rotation

from diagrams.scenario import Scenario
from diagrams.tasks.task_geometry import make_path
from pfsc_drake.geometry import FourierCurve
from pfsc_drake.geometry import Path as GeometricPath
from pfsc_drake.robot.models.files import models_directory, resolve_model
from pfsc_drake.yaml.typed import load_file

TICK = 1e-3  # s
LAWS = ("elastic", "singular_perturbation", "rigid")
LEMNISCATE = GeometricPath(FourierCurve.bent_lemniscate())
PARAMETERS = yaml.safe_load(
    (models_directory() / "comau_racer_1_4" / "parameters.yaml").read_text(encoding="utf-8")
)
K_S = np.array(PARAMETERS["elasticities"]["elastic_3r"]["stiffness"])
ROTORS = PARAMETERS["rotors"]
D_M = (np.array(ROTORS["inertia"]) * np.array(ROTORS["gear_ratio"]) ** 2)[:3]


class RigidArm:
    """The three-axis robot with rigid joints in Drake."""

    def __init__(self) -> None:
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.tool = self.plant.GetFrameByName("tool_point")

    def set_state(self, q, v=(0.0, 0.0, 0.0)):
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)

    def tool_pose(self, q):
        self.set_state(q)
        X_WT = self.tool.CalcPoseInWorld(self.context)
        return X_WT.translation(), X_WT.rotation().matrix()

    def link_torque(self, q, v, acceleration):
        """Return ``D_E(q) q'' + n_E(q, v)`` of (2.65a)."""
        self.set_state(q, v)
        D_E = self.plant.CalcMassMatrix(self.context) - np.diag(D_M)
        weight = -self.plant.CalcGravityGeneralizedForces(self.context)
        return D_E @ acceleration + self.plant.CalcBiasTerm(self.context) + weight

    def jacobian(self, q):
        self.set_state(q)
        world = self.plant.world_frame()
        return self.plant.CalcJacobianTranslationalVelocity(
            self.context, JacobianWrtVariable.kV, self.tool, [0, 0, 0], world, world
        )


@pytest.fixture(scope="module")
def arm():
    return RigidArm()


@pytest.fixture(scope="module")
def six_axes_rigid(run_scenario, tmp_path_factory):
    """The six-axis scenario with the law that sees motors only."""
    slow = "{coefficients: [900, 60]}"
    gains = f"controller.gains.rigid={{eta: {slow}, xi: {slow}, phi: {slow}}}"
    changes = ("--set", "controller.law=rigid", "--set", gains)
    out = tmp_path_factory.mktemp("six_rigid") / "out"
    return run_scenario(out, "pfc_elastic_6r", "--duration", "0.05", *changes)


def _along(theta, y):
    """Return how far a point is from the path's normal plane, zero at its projection (3.6)."""
    sigma, slope = LEMNISCATE.position.derivatives(float(theta), 1)
    return slope @ (y - sigma)


def off_the_path(y_t, theta):
    """Return the transversal coordinates of tool points beside the lemniscate.

    Each point is projected anew, starting at the logged path parameter.
    """
    coordinates = []
    for point, guess in zip(y_t, theta, strict=True):
        on_path = newton(lambda theta, y=point: _along(theta, y), guess, tol=1e-14)
        sigma, slope = LEMNISCATE.position.derivatives(on_path, 1)
        assert abs(slope @ (point - sigma)) < 1e-10
        normals = np.array(LEMNISCATE.frame.normals(on_path))
        coordinates.append(normals @ (point - sigma))
    return np.array(coordinates)


def predicted(coefficients, start, t):
    """Return the solution of the error dynamics (3.67) from a start at rest."""
    companion = np.diag(np.ones(3), 1)
    companion[3] = -np.array(coefficients)
    step = expm(companion * TICK)
    errors = [np.array([start, 0.0, 0.0, 0.0])]
    for _ in t[1:]:
        errors.append(step @ errors[-1])
    return np.array(errors)[:, 0]


def derivative(x):
    """Return the central difference of order four, without two samples at either end."""
    return (-x[4:] + 8.0 * x[3:-1] - 8.0 * x[1:-3] + x[:-4]) / (12.0 * TICK)


@pytest.mark.slow(but="elastic")
@pytest.mark.parametrize("law", LAWS)
def test_signals_of_the_tool(three_axes, arm, law):
    """Tool pose from Drake at the logged joints; coordinates from the pose and the path alone."""
    result = three_axes(f"controller.law={law}")
    rows = slice(None, None, 50)
    poses = [arm.tool_pose(q) for q in result["q_J"][rows]]
    np.testing.assert_allclose(result["y_t"][rows], [y for y, _ in poses], atol=1e-12)
    R_e = result["R_e"][rows].reshape(-1, 3, 3)
    np.testing.assert_allclose(R_e, [R for _, R in poses], atol=1e-12)
    theta = result["theta"][rows, 0]
    xi = off_the_path(result["y_t"][rows], theta)
    np.testing.assert_allclose(result["xi"][rows], xi, atol=1e-9)
    eta = [LEMNISCATE.arc_length(x) for x in theta]
    np.testing.assert_allclose(result["eta"][rows, 0], eta, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["elastic", "rigid"])
def test_orientation_of_the_tool(six_axes, six_axes_rigid, law):
    """The angles away from the path's orientation, from the logged pose and path parameter."""
    result = six_axes if law == "elastic" else six_axes_rigid
    settings = load_file(Scenario, result.folder / "scenario.yaml")
    R_d = make_path(settings.path, law, None).orientation.rotation_matrix(result["theta"][:, 0])
    R_e = result["R_e"].reshape(-1, 3, 3)
    phi = Rotation.from_matrix(R_d.transpose(0, 2, 1) @ R_e).as_euler("ZYX")
    np.testing.assert_allclose(result["phi"], phi, atol=1e-9)
    error = np.abs(result["phi_dot"][2:-2] - derivative(result["phi"])).max()
    assert error < 1e-3 * np.abs(result["phi_dot"]).max()


@pytest.mark.slow(but="elastic")
@pytest.mark.parametrize("law", LAWS)
def test_rates_are_derivatives(three_axes, law):
    result = three_axes(f"controller.law={law}")
    for position, rate in (("q_J", "v_J"), ("q_M", "v_M"), ("eta", "eta_dot"), ("xi", "xi_dot")):
        expected = derivative(result[position])
        scale = np.abs(expected).max()
        error = np.abs(result[rate][2:-2] - expected).max()
        # the motors' acceleration jumps with every tick
        assert error < (2e-3 if position == "q_M" else 2e-4) * scale, position


@pytest.mark.slow(but="elastic")
@pytest.mark.parametrize("law", LAWS)
def test_torques_move_links_and_motors(three_axes, arm, law):
    """Newton's law on both sides of the springs, (2.65), with Drake's rigid links."""
    result = three_axes(f"controller.law={law}")
    tau_J = result["tau_J"]
    np.testing.assert_allclose(tau_J, K_S * (result["q_M"] - result["q_J"]), atol=1e-9)
    largest = np.abs(tau_J).max(axis=0)
    rows = range(0, len(tau_J) - 4, 25)
    a_J = derivative(result["v_J"])
    needed = [arm.link_torque(result["q_J"][i + 2], result["v_J"][i + 2], a_J[i]) for i in rows]
    assert np.all(np.abs(needed - tau_J[2:-2][list(rows)]) < 2e-3 * largest)
    # over one tick: momentum of the rotors, torque held, tau_J by the trapezoidal rule
    impulse = D_M * np.diff(result["v_M"], axis=0) / TICK
    mean_tau_J = (tau_J[1:] + tau_J[:-1]) / 2.0
    assert np.all(np.abs(impulse + mean_tau_J - result["tau_d"][:-1]) < 5e-3 * largest)


@pytest.mark.slow
def test_elastic_law_comes_to_the_path_and_stays(three_axes):
    result = three_axes()
    distance = np.linalg.norm(off_the_path(result["y_t"], result["theta"][:, 0]), axis=1)
    assert distance[0] == pytest.approx(0.01, abs=1e-8)
    moving = result.after(0.3)
    assert np.abs(result["eta_dot"][moving]).max() > 0.9
    assert distance[moving].max() < 0.05e-3
    assert result["eta"][-1, 0] == pytest.approx(0.31, abs=1e-5)


def test_elastic_law_obeys_the_linear_dynamics(three_axes):
    """Tab. 3.3 from 10 mm at rest; the controller is sampled, so not exact."""
    result = three_axes()
    expected = predicted([6_250_000.0, 500_000.0, 15_000.0, 200.0], 0.01, result.t)
    assert np.abs(result["xi"][:, 0] - expected).max() < 5e-6
    assert np.abs(result["xi"][:, 1]).max() < 5e-6
    assert np.abs(result["eta"] - result["eta_p"]).max() < 1e-5


@pytest.mark.slow
def test_six_axes_obey_the_linear_dynamics(six_axes):
    coefficients = np.poly([-60.0, -60.0, -250.0, -350.0])[:0:-1]
    for signal, columns, start in (("xi", [0], 0.01), ("phi", [0, 1, 2], math.radians(1.0))):
        expected = predicted(coefficients, start, six_axes.t)
        for column in columns:
            assert np.abs(six_axes[signal][:, column] - expected).max() < 4e-3 * start
    assert np.abs(six_axes["xi"][:, 1]).max() < 1e-5
    assert np.abs(six_axes["eta"] - six_axes["eta_p"]).max() < 1e-5


@pytest.mark.slow
def test_rigid_law_rests_beside_the_path_by_the_deflection(three_axes, arm):
    """The law sees motors only: the links hang lower by K_s^-1 g_L."""
    result = three_axes("controller.law=rigid", "reference.dwell=1", duration="0.9")
    resting = result.after(0.4)
    q_J, q_M = (result[name][resting].mean(axis=0) for name in ("q_J", "q_M"))
    deflection = -arm.link_torque(q_J, np.zeros(3), np.zeros(3)) / K_S
    np.testing.assert_allclose(q_J - q_M, deflection, atol=0.02 * np.abs(deflection).max())
    xi = off_the_path(result["y_t"][resting], result["theta"][resting, 0]).mean(axis=0)
    normals = np.array(LEMNISCATE.frame.normals(LEMNISCATE.arc_length.parameter(0.96)))
    expected = normals @ arm.jacobian(q_J) @ deflection
    assert np.linalg.norm(expected) > 0.5e-3
    assert np.linalg.norm(xi - expected) < 0.1 * np.linalg.norm(expected)


@pytest.mark.slow
def test_only_the_elastic_law_stays(three_axes):
    deviations = {}
    for law in LAWS:
        result = three_axes(f"controller.law={law}")
        assert result.status == 0
        late = result.after(0.3)
        xi = off_the_path(result["y_t"][late], result["theta"][late, 0])
        deviations[law] = np.linalg.norm(xi, axis=1).max()
    assert deviations["elastic"] < 0.05e-3
    assert deviations["rigid"] > 1e-3
    assert deviations["singular_perturbation"] > 5e-3


@pytest.mark.slow(but="points1--1")
@pytest.mark.parametrize(("points", "revolutions"), [([1.58, 1.68], 1), ([0.03, -0.07], -1)])
def test_a_closed_path_counts_revolutions(three_axes, points, revolutions):
    length = LEMNISCATE.length  # 1.598 m
    reference = f"reference={{points: {points}, velocity: 1.5, acceleration: 20, dwell: 0.1}}"
    result = three_axes(reference, "start.offset=[0, 0]", duration="0.45")
    assert result.status == 0
    end = points[-1]
    assert not 0.0 <= end <= length
    np.testing.assert_allclose(result["eta"], result["eta_p"], atol=2e-5)
    assert result["eta"][-1, 0] == pytest.approx(end, abs=1e-5)
    theta = result["theta"][:, 0]
    assert np.abs(np.diff(theta)).max() < 0.05  # no jump at the seam
    assert LEMNISCATE.arc_length(theta[-1]) == pytest.approx(end, abs=1e-5)
    in_first_period = LEMNISCATE.pose(end - revolutions * length)[0]
    np.testing.assert_allclose(result["y_t"][-1], in_first_period, atol=1e-5)


@pytest.mark.slow(but="elastic")
@pytest.mark.parametrize("law", LAWS)
def test_a_start_on_a_later_lap(three_axes, law):
    result = three_axes(f"controller.law={law}", "reference.points=[4.0, 4.1]", duration="0.05")
    assert 2.0 * LEMNISCATE.length < 4.0 < 3.0 * LEMNISCATE.length
    np.testing.assert_allclose(result["eta"], 4.0, atol=5e-3)
    assert np.all(result["theta"] > 4.0 * math.pi)
