"""Runs through the command line: what they leave, and whether it is physics.

Shipped scenarios, shortened. Logs are read with h5py, as a script of a user would.
"""

import contextlib
import io
import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from diagrams.parts import make_path
from diagrams.scenario import PathFollowingScenario
from experiments.cli import main
from pfsc_drake.geometry import FourierCurve
from pfsc_drake.geometry import Path as GeometricPath
from pfsc_drake.robot.model_files import models_directory, resolve_model
from pfsc_drake.typed_yaml import load_file

TICK = 1e-3  # s
BARE = ("--no-figures", "--no-recording")
FIRST_MOVE = "1.7"  # s, of pfc_elastic_3r
LAWS = ("elastic", "singular_perturbation", "rigid")
LEMNISCATE = GeometricPath(FourierCurve.bent_lemniscate())
PARAMETERS = yaml.safe_load(
    (models_directory() / "comau_racer_1_4" / "parameters.yaml").read_text(encoding="utf-8")
)
K_S = np.array(PARAMETERS["elasticities"]["elastic_3r"]["stiffness"])
ROTORS = PARAMETERS["rotors"]
D_M = (np.array(ROTORS["inertia"]) * np.array(ROTORS["gear_ratio"]) ** 2)[:3]
LIMITS = np.array(PARAMETERS["joint_limits"]["effort"])


@dataclass
class Run:
    """What a run left."""

    status: int
    folder: Path
    stdout: str

    def __post_init__(self) -> None:
        with h5py.File(self.folder / "log.h5") as file:
            self.log = {name: dataset[:] for name, dataset in file.items()}
            self.marks = {name: dict(dataset.attrs) for name, dataset in file.items()}
            self.attributes = dict(file.attrs)
        text = (self.folder / "metrics.json").read_text(encoding="utf-8")
        self.metrics = json.loads(text)

    def __getitem__(self, signal: str) -> np.ndarray:
        return self.log[signal]

    @property
    def t(self) -> np.ndarray:
        """Times of the samples [s]."""
        return self.log["t"]

    def after(self, t: float) -> np.ndarray:
        """Which samples are later."""
        return self.t >= t


def run(out, scenario, *arguments):
    stdout = io.StringIO()
    with contextlib.redirect_stdout(stdout):
        status = main(["run", str(scenario), "--out", str(out), *arguments])
    return Run(status, out, stdout.getvalue())


@pytest.fixture(scope="module")
def three_axes(tmp_path_factory):
    """Return the shipped three-axis scenario, run once per set of overrides."""

    @cache
    def get(*overrides, duration=FIRST_MOVE):
        changes = [argument for change in overrides for argument in ("--set", change)]
        out = tmp_path_factory.mktemp("three") / "out"
        return run(out, "pfc_elastic_3r", *BARE, "--duration", duration, *changes)

    return get


@pytest.fixture(scope="module")
def six_axes(tmp_path_factory):
    """The shipped six-axis scenario with everything that a run can write."""
    out = tmp_path_factory.mktemp("six") / "out"
    return run(out, "pfc_elastic_6r", "--duration", "0.15")


@pytest.fixture(scope="module")
def six_axes_rigid(tmp_path_factory):
    """The six-axis scenario with the law that sees motors only."""
    slow = "{coefficients: [900, 60]}"
    gains = f"controller.gains.rigid={{eta: {slow}, xi: {slow}, phi: {slow}}}"
    changes = ("--set", "controller.law=rigid", "--set", gains)
    out = tmp_path_factory.mktemp("six_rigid") / "out"
    return run(out, "pfc_elastic_6r", *BARE, "--duration", "0.05", *changes)


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


def off_the_path(y_t, theta):
    """Return the transversal coordinates of tool points beside the lemniscate.

    Each point is projected anew, starting at the logged path parameter.
    """
    coordinates = []
    for point, guess in zip(y_t, theta, strict=True):
        on_path = LEMNISCATE.projector.project(point.tolist(), guess).theta
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


# ---------------------------------------------------------------- what a run leaves


def test_files(three_axes):
    bare = three_axes()
    assert bare.status == 0
    names = sorted(path.name for path in bare.folder.iterdir())
    assert names == ["log.h5", "metrics.json", "report.html", "scenario.yaml"]
    assert f"Open the report: {bare.folder / 'report.html'}" in bare.stdout


def test_everything_that_a_run_can_write(six_axes):
    assert six_axes.status == 0
    names = {path.name for path in six_axes.folder.iterdir()}
    assert names == {
        "scenario.yaml",
        "log.h5",
        "metrics.json",
        "figures",
        "recording.html",
        "report.html",
    }
    figures = list((six_axes.folder / "figures").iterdir())
    assert len(figures) >= 5
    for figure in figures:
        assert figure.read_bytes().startswith(b"\x89PNG")
    recording = (six_axes.folder / "recording.html").read_text(encoding="utf-8")
    assert len(recording) > 500_000
    report = (six_axes.folder / "report.html").read_text(encoding="utf-8")
    assert "recording.html" in report
    assert report.count("data:image/png;base64,") == len(figures)
    for text in ("pfc_elastic_6r", "max_orientation_error", "keyframes"):
        assert text in report


SIGNALS = {
    # name: unit, labels
    "y_t": ("m", ["x", "y", "z"]),
    "R_e": ("1", [f"r{i}{j}" for i in "123" for j in "123"]),
    "theta": ("1", ["theta"]),
    "alpha": ("1", ["alpha"]),
    "eta": ("m", ["eta"]),
    "eta_dot": ("m/s", ["eta_dot"]),
    "eta_p": ("m", ["eta_p"]),
    "xi": ("m", ["xi_1", "xi_2"]),
    "xi_dot": ("m/s", ["xi_1_dot", "xi_2_dot"]),
    "xi_p": ("m", ["xi_1_p", "xi_2_p"]),
    "rcond": ("1", ["rcond"]),
    "saturated_drives": ("1", ["saturated_drives"]),
}
ORIENTATION = {
    "phi": ("rad", ["phi_z", "phi_y", "phi_x"]),
    "phi_dot": ("rad/s", ["phi_z_dot", "phi_y_dot", "phi_x_dot"]),
    "phi_p": ("rad", ["phi_z_p", "phi_y_p", "phi_x_p"]),
}
JOINTS = {
    "q_J": "rad",
    "q_M": "rad",
    "v_J": "rad/s",
    "v_M": "rad/s",
    "tau_d": "Nm",
    "tau_J": "Nm",
}


@pytest.mark.parametrize(("axes", "samples"), [(3, 1701), (6, 151)])
def test_log(three_axes, six_axes, axes, samples):
    result = three_axes() if axes == 3 else six_axes
    assert result.marks["t"]["unit"] == "s"
    np.testing.assert_allclose(result.t, TICK * np.arange(samples), atol=1e-9)
    signals = SIGNALS | (ORIENTATION if axes == 6 else {})
    signals |= {
        name: (unit, [f"{name}_{i + 1}" for i in range(axes)]) for name, unit in JOINTS.items()
    }
    for name, (unit, labels) in signals.items():
        assert result.marks[name]["unit"] == unit
        assert list(result.marks[name]["labels"]) == labels
        assert result[name].shape == (samples, len(labels))
        assert np.isfinite(result[name]).all()
    assert ("phi" in result.log) == (axes == 6)
    np.testing.assert_array_equal(result.marks["tau_d"]["limits"], LIMITS[:axes])
    assert result["fault"].dtype.kind == "i"
    assert result.marks["fault"]["labels"][0] == "none"


def test_attributes_of_the_log(three_axes):
    attributes = three_axes().attributes
    assert attributes["scenario"] == "pfc_elastic_3r"
    assert "fault" not in attributes
    for name in ("git_revision", "drake_version", "casadi_version", "numpy_version"):
        assert attributes[name]
    assert attributes["numpy_version"] == np.__version__


def test_metrics(six_axes):
    for name, metric in six_axes.metrics.items():
        assert set(metric) <= {"value", "unit", "target", "source"}, name
        assert {"value", "unit"} <= set(metric), name
        assert metric["value"] is None or isinstance(metric["value"], float), name
    assert six_axes.metrics["controller_tick_us"]["unit"] == "us"
    median, p99 = (six_axes.metrics[f"controller_tick_us{x}"]["value"] for x in ("", "_p99"))
    assert 1.0 < median <= p99
    assert six_axes.metrics["real_time_factor"]["value"] > 0.5
    targets = {name for name, metric in six_axes.metrics.items() if "target" in metric}
    assert {"max_path_deviation", "max_orientation_error", "controller_tick_us"} <= targets


def test_metrics_follow_from_the_log(three_axes):
    result = three_axes()
    distance = np.linalg.norm(result["xi"], axis=1)
    assert result.metrics["max_path_deviation"]["value"] == distance[result.after(0.3)].max()
    speed = np.abs(result["eta_dot"]).max()
    assert result.metrics["peak_speed"]["value"] == speed
    assert result.metrics["saturated_samples"]["value"] == 0.0
    torques = [result.metrics[f"peak_torque_{i}"]["value"] for i in (1, 2, 3)]
    np.testing.assert_array_equal(torques, np.abs(result["tau_d"]).max(axis=0))


def test_the_resolved_scenario_gives_the_same_run(three_axes, tmp_path):
    first = three_axes("start.offset=[0.005, -0.002]", "reference.dwell=0.02", duration="0.1")
    again = run(tmp_path / "again", first.folder / "scenario.yaml", *BARE)
    assert again.status == 0
    assert set(again.log) == set(first.log)
    for name in first.log:
        np.testing.assert_array_equal(again[name], first[name], err_msg=name)
    resolved = [(r.folder / "scenario.yaml").read_text(encoding="utf-8") for r in (first, again)]
    assert resolved[0] == resolved[1]
    assert again.attributes["scenario"] == "pfc_elastic_3r"


def test_files_of_an_earlier_run_are_replaced(tmp_path):
    out = tmp_path / "out"
    run(out, "pfc_elastic_3r", "--duration", "0.05", "--set", "controller.law=rigid")
    assert (out / "recording.html").is_file()
    assert (out / "figures").is_dir()
    later = run(out, "pfc_elastic_3r", *BARE, "--duration", "0.02")
    assert len(later.t) == 21
    names = sorted(path.name for path in out.iterdir())
    assert names == ["log.h5", "metrics.json", "report.html", "scenario.yaml"]
    assert "recording.html" not in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("duration", ["0.001", "0.0305", "0.35", "1.4"])
def test_duration_is_kept_to_the_sample(three_axes, duration):
    """Also where the sum of the steps between two looks at the run is not exact."""
    result = three_axes("controller.law=rigid", duration=duration)
    assert len(result.t) == math.floor(float(duration) / TICK + 1e-6) + 1


def test_duration_of_the_scenario_and_of_its_reference(tmp_path):
    changes = ["controller.law=rigid", "reference.points=[0.96, 0.961]", "reference.dwell=0.01"]
    arguments = [x for change in changes for x in ("--set", change)]
    # two ramps of 35/16 v/a each, the way between them is half of their time times v
    ramp = math.sqrt(35.0 / 16.0 * 0.001 / 3.0)
    whole = run(tmp_path / "whole", "pfc_elastic_3r", *BARE, *arguments)
    assert len(whole.t) == math.floor((2.0 * ramp + 0.02) / TICK) + 1
    short = run(tmp_path / "short", "pfc_elastic_3r", *BARE, *arguments, "--set", "duration=0.03")
    assert len(short.t) == 31


# ---------------------------------------------------------------- whether it is physics


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
    eta = [LEMNISCATE.arc_length.at(x) for x in theta]
    np.testing.assert_allclose(result["eta"][rows, 0], eta, atol=1e-9)


@pytest.mark.parametrize("law", ["elastic", "rigid"])
def test_orientation_of_the_tool(six_axes, six_axes_rigid, law):
    """The angles away from the path's orientation, from the logged pose and path parameter."""
    result = six_axes if law == "elastic" else six_axes_rigid
    settings = load_file(PathFollowingScenario, result.folder / "scenario.yaml")
    R_d = make_path(settings.path, law, None).orientation.rotation_matrix(result["theta"][:, 0])
    R_e = result["R_e"].reshape(-1, 3, 3)
    phi = Rotation.from_matrix(R_d.transpose(0, 2, 1) @ R_e).as_euler("ZYX")
    np.testing.assert_allclose(result["phi"], phi, atol=1e-9)
    error = np.abs(result["phi_dot"][2:-2] - derivative(result["phi"])).max()
    assert error < 1e-3 * np.abs(result["phi_dot"]).max()


@pytest.mark.parametrize("law", LAWS)
def test_rates_are_derivatives(three_axes, law):
    result = three_axes(f"controller.law={law}")
    for position, rate in (("q_J", "v_J"), ("q_M", "v_M"), ("eta", "eta_dot"), ("xi", "xi_dot")):
        expected = derivative(result[position])
        scale = np.abs(expected).max()
        error = np.abs(result[rate][2:-2] - expected).max()
        # the motors' acceleration jumps with every tick
        assert error < (2e-3 if position == "q_M" else 2e-4) * scale, position


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


def test_six_axes_obey_the_linear_dynamics(six_axes):
    coefficients = np.poly([-55.0] * 4)[:0:-1]
    for signal, columns, start in (("xi", [0], 0.01), ("phi", [0, 1, 2], math.radians(1.0))):
        expected = predicted(coefficients, start, six_axes.t)
        for column in columns:
            assert np.abs(six_axes[signal][:, column] - expected).max() < 4e-3 * start
    assert np.abs(six_axes["xi"][:, 1]).max() < 1e-5
    assert np.abs(six_axes["eta"] - six_axes["eta_p"]).max() < 1e-5


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


@pytest.mark.parametrize(("points", "laps"), [([1.58, 1.68], 1), ([0.03, -0.07], -1)])
def test_a_closed_path_counts_laps(three_axes, points, laps):
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
    assert LEMNISCATE.arc_length.at(theta[-1]) == pytest.approx(end, abs=1e-5)
    on_first_lap = LEMNISCATE.pose(end - laps * length)[0]
    np.testing.assert_allclose(result["y_t"][-1], on_first_lap, atol=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_a_start_on_a_later_lap(three_axes, law):
    result = three_axes(f"controller.law={law}", "reference.points=[4.0, 4.1]", duration="0.05")
    assert 2.0 * LEMNISCATE.length < 4.0 < 3.0 * LEMNISCATE.length
    np.testing.assert_allclose(result["eta"], 4.0, atol=5e-3)
    assert np.all(result["theta"] > 4.0 * math.pi)


# ---------------------------------------------------------------- a user's own scenario

ARC = np.linspace(0.0, 1.2, 9)
ARC_POINTS = np.stack([0.9 - 0.1 * ARC, -0.2 + 0.3 * np.sin(ARC), 1.0 + 0.05 * ARC**2], axis=1)
ARC_ZYX = np.stack([np.pi + 0.1 * ARC, -0.3 + 0.2 * ARC, -0.1 * ARC], axis=1)
OWN_SCENARIO = """
description: A spline of my own.
robot: {model: comau_racer_1_4_elastic}
path:
  shape: !Waypoints {file: points/arc.csv}
controller:
  law: elastic
  gains:
    elastic:
      eta: {poles: [-50, -50, -50, -50]}
      xi: {poles: [-50, -50, -50, -50]}
      phi: {poles: [-50, -50, -50, -50]}
reference: {points: [0.05, 0.08], velocity: 0.5, acceleration: 2, dwell: 0.02}
start: {posture_deg: [0, 115, -40, 0, 95, 0]}
"""


@pytest.fixture
def own_scenario(tmp_path):
    """A scenario and its waypoints, in the folders of a user."""
    folder = tmp_path / "mine"
    (folder / "points").mkdir(parents=True)
    header = "x, y, z, zyx_1, zyx_2, zyx_3  # m, rad\n"
    rows = [", ".join(map(repr, row)) for row in np.hstack([ARC_POINTS, ARC_ZYX]).tolist()]
    (folder / "points" / "arc.csv").write_text(header + "\n".join(rows), encoding="utf-8")
    (folder / "own.yaml").write_text(OWN_SCENARIO, encoding="utf-8")
    return folder / "own.yaml"


def test_own_scenario(own_scenario, tmp_path, monkeypatch):
    """The waypoints are found beside the scenario, wherever the command is given."""
    monkeypatch.chdir(tmp_path)
    result = run(tmp_path / "out", "mine/own.yaml", *BARE)
    assert result.status == 0
    assert result.attributes["scenario"] == "own"
    assert result["eta"][0, 0] == pytest.approx(0.05, abs=1e-8)
    assert result["eta"][-1, 0] == pytest.approx(0.08, abs=1e-5)
    assert np.abs(result["xi"]).max() < 1e-5
    assert np.abs(result["phi"]).max() < 2e-5
    # the nearest place on the arc, in closed form on a fine grid
    fine = np.linspace(0.0, 1.2, 120_001)
    arc = np.stack([0.9 - 0.1 * fine, -0.2 + 0.3 * np.sin(fine), 1.0 + 0.05 * fine**2], axis=1)
    for k in (0, -1):
        distance = np.linalg.norm(arc - result["y_t"][k], axis=1)
        nearest = int(np.argmin(distance))
        assert distance[nearest] < 2e-5
        zyx = np.array([np.pi, -0.3, 0.0]) + np.array([0.1, 0.2, -0.1]) * fine[nearest]
        expected = Rotation.from_euler("ZYX", zyx).as_matrix()
        np.testing.assert_allclose(result["R_e"][k].reshape(3, 3), expected, atol=1e-4)


def test_the_resolved_scenario_still_finds_its_waypoints(own_scenario, tmp_path):
    arguments = [*BARE, "--duration", "0.02"]
    first = run(tmp_path / "out", own_scenario, *arguments)
    again = run(tmp_path / "again", first.folder / "scenario.yaml", *arguments)
    assert again.status == 0
    assert again.attributes["scenario"] == "own"
    np.testing.assert_array_equal(again["q_J"], first["q_J"])
