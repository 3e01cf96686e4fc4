"""Wrong input and faults on the way, through the command line.

Wrong input: status 2, one line on stderr that names the file, the thing, the value and what is
allowed; nothing is simulated. A fault: status 3, everything logged so far is kept.
"""

import json
import math
import shutil

import h5py
import numpy as np
import pytest

from experiments.cli import main
from experiments.scenario_catalog import find_scenario
from pfsc_drake.robot.model_files import resolve_model

THREE, SIX = "pfc_elastic_3r", "pfc_elastic_6r"
BARE = ("--no-figures", "--no-recording")
ANGLE = np.linspace(0.0, 1.5, 9)
POINTS = np.stack([0.8 + 0.0 * ANGLE, 0.2 * np.sin(ANGLE), 1.0 + 0.1 * ANGLE], axis=1)


@pytest.fixture
def mine(tmp_path):
    """Return the path of a shipped scenario, copied into a folder of the user's own."""

    def copy(name=THREE):
        return str(shutil.copy(find_scenario(name), tmp_path / f"my_{name}.yaml"))

    return copy


@pytest.fixture
def refused(tmp_path, capfd):
    """Run a scenario that is wrong and check the line on stderr."""

    def check(scenario, *parts, changes=(), file=None):
        out = tmp_path / "out"
        overrides = [argument for change in changes for argument in ("--set", change)]
        capfd.readouterr()
        arguments = ["run", str(scenario), "--out", str(out), "--duration", "0.02", *BARE]
        status = main([*arguments, *overrides])
        stderr = capfd.readouterr().err
        assert status == 2, stderr
        assert stderr.startswith("error: ")
        assert stderr.endswith("\n")
        assert stderr.count("\n") == 1
        assert str(file or scenario) in stderr
        for part in parts:
            assert part in stderr
        assert not (out / "log.h5").exists()

    return check


# ---------------------------------------------------------------- the scenario file


def test_missing_scenario(refused, tmp_path):
    refused(tmp_path / "none.yaml", "scenario file", "no such file")
    refused(f"{tmp_path}/", "is a folder")


def test_unknown_name(refused):
    refused("pfc_elastic_4r", "unknown scenario", "did you mean 'pfc_elastic_", THREE, SIX)


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (b"\xff\xfe\x00", ("cannot be read", "UTF-8")),
        (b"", ("empty", "a mapping")),
        (b"[1, 2]", ("list", "a mapping")),
        (b"name: [1\nrobot: 2\n", ("invalid YAML in line 2",)),
        (b"name: x\n\tduration: 1\n", ("invalid YAML in line 2",)),
        (b"name: x\nname: y\n", ("'name'", "line 2")),
    ],
)
def test_unreadable_scenario(refused, tmp_path, content, parts):
    file = tmp_path / "mine.yaml"
    file.write_bytes(content)
    refused(file, *parts)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        # unknown keys
        ("controler.law=rigid", ("'controler'", "did you mean 'controller'", "allowed")),
        ("start.ofset=[0, 0]", ("'start.ofset'", "did you mean 'offset'", "posture_deg")),
        ("path.shape=!Spiral {}", ("path.shape", "!Spiral", "!Circle")),
        ("path.shape=!Circle {radus: 1}", ("path.shape.radus", "did you mean 'radius'")),
        # wrong types
        ("duration=long", ("'duration'", "'long'", "a number")),
        ("duration=.nan", ("'duration'", "nan", "a number")),
        ("reference.points=0.5", ("reference.points", "0.5", "a list")),
        ("reference.points=[0, x]", ("reference.points[1]", "'x'", "a number")),
        ("controller=elastic", ("'controller'", "'elastic'", "a mapping")),
        ("robot=null", ("'robot'", "empty", "a mapping")),
        ("name=3", ("'name'", "3", "text")),
        # wrong values
        ("controller.law=magic", ("law", "magic", "elastic")),
        ("path.orientation.convention=xyz", ("convention", "xyz", "zyx, zyz")),
        # wrong dimensions
        ("start.offset=[0.01]", ("offset", "[0.01]", "2 finite numbers")),
        ("start.rotation_deg=[1, 2]", ("rotation_deg", "[1.0, 2.0]", "3 finite numbers")),
        ("start.posture_deg=[15, 115]", ("start.posture_deg", "2 values", "3 joints")),
        (
            "path.orientation.keyframes=[{angles_deg: [1, 2, 3, 4]}]",
            ("keyframes[0].angles_deg", "4.0", "3 finite numbers"),
        ),
        ("path.shape=!Line {start: [1, 2]}", ("start", "[1.0, 2.0]", "3")),
        ("path.shape=!Circle {center: [1, 2]}", ("center", "[1.0, 2.0]", "3")),
        ("path.shape=!Circle {axis_u: [0, 1]}", ("axis_u", "[0.0, 1.0]", "3")),
        # paths that are none
        ("path.shape=!Circle {radius: -1}", ("radius", "-1", "positive")),
        ("path.shape=!Circle {axis_u: [0, 0, 1]}", ("axes", "independent")),
        ("path.shape=!Line {start: [1, 0, 0], end: [1, 0, 0]}", ("line", "two different")),
        # references
        ("reference.points=[0.96]", ("points", "[0.96]", "two or more")),
        ("reference.points=[]", ("points", "[]", "two or more")),
        ("reference.velocity=0", ("velocity", "0", "positive")),
        ("reference.acceleration=-1", ("acceleration", "-1", "positive")),
        ("reference.dwell=-1", ("dwell", "-1", "zero or a positive")),
        # times
        ("duration=-1", ("duration", "-1", "positive")),
        ("controller.sampling_time=0", ("sampling_time", "0", "positive")),
        ("simulation.integrator=magic", ("integrator", "magic", "runge_kutta3")),
        ("simulation.frame_period=0", ("frame_period", "0", "positive")),
        # sensors and targets that are not there
        ("simulation.sensor_failure={time: 1, component: 12}", ("component", "12", "0 to 11")),
        ("targets.elastic.magic={bound: '< 1'}", ("magic", "max_path_deviation")),
    ],
)
def test_scenario_that_says_something_wrong(refused, mine, change, parts):
    refused(mine(), *parts, changes=[change])


@pytest.mark.parametrize("damping", ["[]", "[0.04]", "[0.04, 0.04, -0.02]"])
def test_boundary_layer_damping(refused, mine, damping):
    changes = [
        "controller.law=singular_perturbation",
        f"controller.boundary_layer_damping={damping}",
    ]
    refused(mine(), "boundary_layer_damping", "3 positive values", changes=changes)


@pytest.mark.parametrize(
    ("gains", "parts"),
    [
        ("{poles: [-50, -50, -50, 1]}", ("eta", "not Hurwitz", "pole at 1", "negative")),
        ("{poles: [-50, -50, -50, 0]}", ("eta", "not Hurwitz")),
        ("{coefficients: [6250000, 500000, 15000, -200]}", ("eta", "-200", "not Hurwitz")),
        ("{coefficients: [1, 1, 1, 1]}", ("eta", "not Hurwitz")),  # all positive, yet unstable
        (
            "{coefficients: [6250000, 500000, 15000, 200], integral: 1e+9}",
            ("eta", "a_0", "not Hurwitz"),
        ),
        ("{poles: [-50, -50]}", ("eta", "2 gains", "needs 4")),
        ("{coefficients: [900, 60]}", ("controller.gains.elastic.eta", "2", "needs 4")),
        ("{}", ("controller.gains.elastic.eta", "needs 4")),
        ("{poles: [-1, -1, -1, -1], integral: 1}", ("poles", "either")),
        ("{poles: [-50, -50, -50, -.inf]}", ("eta", "finite")),
    ],
)
def test_gains(refused, mine, gains, parts):
    refused(mine(), *parts, changes=[f"controller.gains.elastic.eta={gains}"])


def test_no_gains_for_the_law(refused, mine):
    parts = ("controller.gains", "'visco_elastic'", "elastic, singular_perturbation, rigid")
    refused(mine(), *parts, changes=["controller.law=visco_elastic"])


# ---------------------------------------------------------------- waypoints


def csv(folder, points=POINTS, header="x,y,z", name="points.csv"):
    rows = [",".join(map(str, row)) for row in np.asarray(points, dtype=object).tolist()]
    (folder / name).write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return folder / name


def spline(more=""):
    return [f"path.shape=!Waypoints {{file: points.csv{more}}}", "reference.points=[0.05, 0.1]"]


def test_these_waypoints_are_fine(mine, tmp_path):
    csv(tmp_path)
    overrides = [argument for change in spline() for argument in ("--set", change)]
    out = tmp_path / "out"
    assert main(["run", mine(), "--out", str(out), "--duration", "0.02", *BARE, *overrides]) == 0


def test_missing_waypoints(refused, mine, tmp_path):
    file = tmp_path / "points.csv"
    refused(mine(), "No such file", "CSV", changes=spline(), file=file)
    file.mkdir()
    refused(mine(), "Is a directory", "CSV", changes=spline(), file=file)
    refused(mine(), "CSV", changes=["path.shape=!Waypoints {}"])


@pytest.mark.parametrize("bad", ["abc", "", "nan", "inf", "1,5"])
def test_a_bad_number_among_waypoints(refused, mine, tmp_path, bad):
    points = POINTS.astype(object)
    points[2, 1] = bad
    file = csv(tmp_path, points)
    refused(mine(), "line 4", changes=spline(), file=file)


@pytest.mark.parametrize(
    ("header", "part"), [("x,y,w", "'w'"), ("x,y,x", "'x'"), ("x,y", "'z'"), ("", "'0.8'")]
)
def test_columns_of_waypoints(refused, mine, tmp_path, header, part):
    refused(mine(), "line", part, changes=spline(), file=csv(tmp_path, header=header))


def test_binary_and_empty_waypoints(refused, mine, tmp_path):
    file = tmp_path / "points.csv"
    file.write_bytes(b"\xff\xfe\x00\x01")
    refused(mine(), "not a text file", changes=spline(), file=file)
    file.write_text("x,y,z\n", encoding="utf-8")
    refused(mine(), "no waypoints", changes=spline(), file=file)


def test_duplicate_waypoints(refused, mine, tmp_path):
    csv(tmp_path, np.insert(POINTS, 4, POINTS[3], axis=0))
    place = str(POINTS[3].tolist())
    refused(mine(), "rows 3 and 4", place, "must differ", changes=spline())


def test_too_few_waypoints(refused, mine, tmp_path):
    csv(tmp_path, POINTS[:6])
    refused(mine(), "6 distinct", "C^5", "at least 7", changes=spline())


def test_path_of_too_low_class(refused, mine, tmp_path):
    csv(tmp_path)
    parts = ("C^2", "C^5", "'elastic'", "theta = ")
    refused(mine(), *parts, changes=spline(", smoothness: 2"))
    parts = ("C^4", "C^5", "'elastic'")
    refused(mine(), *parts, changes=spline(", smoothness: 4"))


def test_reference_beyond_the_ends_of_an_open_path(refused, mine, tmp_path):
    csv(tmp_path)
    for point in (9.0, -0.01):
        changes = [*spline(), f"reference.points=[0.05, {point}]"]
        refused(mine(), "reference.points", f"{point:g} m", "open", "m long", changes=changes)


# ---------------------------------------------------------------- robot, law and start


def test_missing_model(refused, mine, tmp_path):
    refused(mine(), "'nope'", "comau_racer_1_4_elastic", changes=["robot.model=nope"])
    file = tmp_path / "nope.sdf"
    refused(mine(), "no such file", changes=["robot.model=nope.sdf"], file=file)


@pytest.mark.parametrize(
    "content", ["no robot", "<sdf version='1.9'><model name='x'>", "<robot name='x'/>"]
)
def test_unreadable_model(refused, mine, tmp_path, content):
    file = tmp_path / "arm.sdf"
    file.write_text(content, encoding="utf-8")
    refused(mine(), "robot.model", changes=["robot.model=arm.sdf"], file=file)


def test_no_such_tool_frame(refused, mine):
    parts = ("robot.tool_frame", "comau_racer_1_4_elastic_3r", "'gripper'")
    refused(mine(), *parts, changes=["robot.tool_frame=gripper"])


def test_a_tool_that_does_not_move(refused, mine):
    refused(mine(), "'base'", "no moving joint", changes=["robot.tool_frame=base"])


def test_a_joint_without_drive(refused, mine, tmp_path):
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    lame = text.replace("<effort>900</effort>", "<effort>0</effort>")
    assert lame != text
    (tmp_path / "lame.sdf").write_text(lame, encoding="utf-8")
    refused(mine(), "robot.model", "actuator", changes=["robot.model=lame.sdf"])


@pytest.mark.parametrize("law", ["elastic", "singular_perturbation"])
def test_law_for_elastic_joints_on_a_rigid_robot(refused, mine, law):
    changes = ["robot.model=comau_racer_1_4_3r", f"controller.law={law}"]
    refused(mine(), f"'{law}'", "elastic joints", "joint_1", changes=changes)


def test_as_many_outputs_as_joints(refused, mine):
    parts = ("6 joints", "3 outputs", "position only")
    refused(mine(SIX), *parts, changes=["path.orientation.keyframes=[]"])
    parts = ("3 joints", "6 outputs", "position and orientation")
    refused(mine(), *parts, changes=["path.orientation.keyframes=[{theta: 0}]"])


def test_a_servo_that_does_not_fit_the_controller(refused, mine):
    gains = "{eta: {poles: [-10]}, xi: {poles: [-10]}}"
    changes = ["controller.law=velocity_servo", f"controller.gains.velocity_servo={gains}"]
    parts = ("servo.period", "0.0003", "controller.sampling_time", "0.001")
    refused(mine(), *parts, changes=[*changes, "servo.period=0.0003"])
    parts = ("delay", "0.0015", "multiple of the period")
    refused(mine(), *parts, changes=[*changes, "servo.bus_delay=0.0015"])


def test_start_outside_the_feasible_neighbourhood(refused, mine):
    """60 mm inwards on a circle of 50 mm: e_cross points outwards."""
    changes = ["path.shape=!Circle {radius: 0.05}", "reference.points=[0, 0.1]"]
    parts = ("start.offset", "-0.06", "feasible neighbourhood", "alpha", "below 0.95")
    refused(mine(), *parts, changes=[*changes, "start.offset=[0, -0.06]"])


def test_unreachable_start(refused, mine):
    changes = ["path.shape=!Line {start: [3, 0, 1], end: [3, 1, 1]}", "reference.points=[0, 0.5]"]
    refused(mine(), "start", "3.0", "unreachable", "joint limits", changes=changes)
    # the place is in reach, the orientation is not
    # with the tool pointing away from the robot the place is in reach, but not back towards it
    changes = [
        "path.shape=!Line {start: [1.3, 0, 1], end: [1.3, 0.6, 1]}",
        "reference.points=[0, 0.5]",
        "path.orientation.keyframes=[{angles_deg: [0, -90, 0]}]",
    ]
    refused(mine(SIX), "start", "pose", "unreachable", changes=changes)


# ---------------------------------------------------------------- faults on the way


@pytest.fixture
def fault(tmp_path, capfd, mine):
    """Run into a fault and return log, its attributes and metrics."""

    def check(explanation, *changes, name=THREE, duration="0.5"):
        out = tmp_path / "out"
        overrides = [argument for change in changes for argument in ("--set", change)]
        capfd.readouterr()
        arguments = ["run", mine(name), "--out", str(out), "--duration", duration, *BARE]
        status = main([*arguments, *overrides])
        stderr = capfd.readouterr().err
        assert status == 3, stderr
        assert stderr.startswith("fault: ")
        assert stderr.count("\n") == 1
        assert explanation in stderr
        assert "stopped at t = " in stderr
        assert str(out) in stderr
        report = (out / "report.html").read_text(encoding="utf-8")
        assert explanation in report
        metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
        with h5py.File(out / "log.h5") as file:
            assert explanation in file.attrs["fault"]
            log = {key: dataset[:] for key, dataset in file.items()}
            log["limits"] = file["tau_d"].attrs["limits"]
            labels = list(file["fault"].attrs["labels"])
        log["fault"] = np.array([labels[code] for code in log["fault"][:, 0]])
        # the drives obey their limits, whatever happens, and the rest is on one time axis
        assert np.all(np.abs(log["tau_d"]) <= log["limits"])
        assert {len(x) for key, x in log.items() if key != "limits"} == {len(log["t"])}
        return log, metrics

    return check


@pytest.mark.parametrize("component", [0, 5, 6, 11])
def test_nan_on_the_way(fault, component):
    failure = f"simulation.sensor_failure={{time: 0.0305, component: {component}}}"
    log, metrics = fault("not a finite number", failure)
    healthy = log["t"] < 0.0305
    assert set(log["fault"][healthy]) == {"none"}
    assert set(log["fault"][~healthy]) == {"input_not_finite"}
    measured = np.hstack([log[name] for name in ("q_J", "v_J", "q_M", "v_M")])
    assert np.isfinite(measured[healthy]).all()
    assert np.isnan(measured[~healthy, component]).all()
    # looked at every 50 ms; until then the drives hold the arm
    assert log["t"][-1] < 0.1
    assert np.isfinite(log["tau_d"]).all()
    assert np.abs(np.delete(measured[-1] - measured[30], component)).max() < 1.0
    assert metrics["saturated_samples"]["value"] == 0.0


@pytest.mark.parametrize("name", [THREE, SIX])
def test_nan_from_the_beginning(fault, name):
    log, metrics = fault("not a finite number", "simulation.sensor_failure.time=0", name=name)
    assert set(log["fault"]) == {"input_not_finite"}
    assert np.isfinite(log["tau_d"]).all()
    assert metrics["max_path_deviation"]["value"] is None


def test_singularity_on_the_way(fault):
    """A line leads beyond what the stretched arm reaches."""
    log, _ = fault(
        "singular",
        "path.shape=!Line {start: [1.1, 0, 1], end: [2, 0, 1]}",
        "reference={points: [0, 0.8], velocity: 1, acceleration: 8, dwell: 0}",
        "start.offset=[0, 0]",
        duration="1.5",
    )
    last_good = np.flatnonzero(log["fault"] == "none")[-1]
    assert set(log["fault"][last_good + 1 :]) == {"singular"}
    assert log["rcond"][:last_good, 0].min() >= 1e-3
    # until the drives gave out the law was exact: first torques, then geometry
    exact = np.cumsum(log["saturated_drives"][:, 0]) == 0
    assert np.abs(log["xi"][exact]).max() < 1e-3
    assert 0.2 < log["eta"][last_good, 0] < 0.8


def test_leaving_the_feasible_neighbourhood_on_the_way(fault):
    """Drives too weak for the arm's weight: it sinks from a circle's top through its centre."""
    radius = 0.05
    top = radius * math.pi / 2.0
    log, metrics = fault(
        "left the feasible neighbourhood",
        f"path.shape=!Circle {{radius: {radius}}}",
        f"reference.points=[{top}, 0.2]",
        "start.offset=[0, 0]",
        "controller.effort_scale=0.03",
    )
    np.testing.assert_allclose(log["limits"], [54.0, 54.0, 27.0])
    last_good = np.flatnonzero(log["fault"] == "none")[-1]
    assert set(log["fault"][last_good + 1 :]) == {"outside_feasible_neighbourhood"}
    assert log["alpha"][last_good, 0] < 0.95
    # alpha is the way from the circle to its axis, as a part of the radius
    depth = radius - np.linalg.norm((log["y_t"] - [0.8, 0.0, 1.0])[:, 1:], axis=1)
    assert 0.9 * radius < depth[last_good] < 0.96 * radius
    assert metrics["saturated_samples"]["value"] > 20


def test_torque_saturation_is_counted_and_survived(mine, tmp_path, capfd):
    """The first torque wants 202 Nm of axis 1; a tenth of its limit is 180 Nm."""
    out = tmp_path / "out"
    arguments = ["--set", "controller.effort_scale=0.1", "--duration", "0.3", *BARE]
    assert main(["run", mine(), "--out", str(out), *arguments]) == 0
    assert capfd.readouterr().err == ""
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    with h5py.File(out / "log.h5") as file:
        tau_d, limits = file["tau_d"][:], file["tau_d"].attrs["limits"]
        saturated, xi = file["saturated_drives"][:, 0], file["xi"][:]
    np.testing.assert_allclose(limits, [180.0, 180.0, 90.0])
    at_limit = np.any(np.abs(tau_d) == limits, axis=1)
    assert np.all(np.abs(tau_d) <= limits)
    assert 0 < at_limit.sum() < 50
    np.testing.assert_array_equal(saturated > 0, at_limit)
    assert metrics["saturated_samples"]["value"] == at_limit.sum()
    assert np.linalg.norm(xi[-1]) < 1e-4  # nevertheless on the path in the end


# ---------------------------------------------------------------- where results go


def test_results_cannot_be_written(mine, tmp_path, capfd):
    (tmp_path / "file").write_text("x", encoding="utf-8")
    for out in (tmp_path / "file", tmp_path / "file" / "out"):
        capfd.readouterr()
        assert main(["run", mine(), "--out", str(out), "--duration", "0.02", *BARE]) == 2
        stderr = capfd.readouterr().err
        assert stderr.startswith("error: ")
        assert stderr.count("\n") == 1
        assert str(out) in stderr
