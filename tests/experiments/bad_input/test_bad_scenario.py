"""Wrong scenarios through the command line: file, keys, values, gains, where results go.

Status 2, one line on stderr that names the file, the thing, the value and what is allowed; nothing
is simulated.
"""

from pathlib import Path

import pytest

from experiments.cli import main

THREE, SIX = "pfc_elastic_3r", "pfc_elastic_6r"
BARE = ("--no-figures", "--no-recording")


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
        (
            "start.posture_deg=[15, 115]",
            ("start.posture_deg = [15.0, 115.0]; allowed: 3 values, one per joint",),
        ),
        (
            "path.orientation.keyframes=[{angles_deg: [1, 2, 3, 4]}]",
            ("keyframes[0].angles_deg", "4.0", "3 finite numbers"),
        ),
        ("path.shape=!Line {start: [1, 2]}", ("start", "[1.0, 2.0]", "3")),
        ("path.shape=!Circle {center: [1, 2]}", ("center", "[1.0, 2.0]", "3")),
        ("path.shape=!Circle {axis_u: [0, 1]}", ("axis_u", "[0.0, 1.0]", "3")),
        # paths that are none
        ("path.shape=!Circle {radius: -1}", ("radius", "-1", "0.0001 to 10000 m")),
        ("path.shape=!Circle {axis_u: [0, 0, 1]}", ("axes", "0 deg between", "at least 0.1 deg")),
        (
            "path.shape=!Line {start: [1, 0, 0], end: [1, 0, 0]}",
            ("distance of start and end = 0", "0.0001 m"),
        ),
        # references
        ("reference.points=[0.96]", ("points", "[0.96]", "two or more")),
        ("reference.points=[]", ("points", "[]", "two or more")),
        ("reference.velocity=0", ("velocity", "0", "positive")),
        ("reference.acceleration=-1", ("acceleration", "-1", "positive")),
        ("reference.dwell=-1", ("dwell", "-1", "0, or 1e-06 to")),
        # regions that nothing would keep the tool out of
        (
            "fixtures={regions: [{shape: !Plane {}}]}",
            ("fixtures.regions = 1 given", "none with controller.manifold = path"),
        ),
        # times
        ("duration=-1", ("duration", "-1", "positive")),
        ("controller.sampling_time=0", ("sampling_time", "0", "positive")),
        ("simulation.integrator=magic", ("integrator", "magic", "runge_kutta3")),
        ("simulation.frame_period=0", ("frame_period", "0", "positive")),
        ("hand={reaction_delay: 1e5}", ("hand.reaction_delay", "multiple", "up to 10 s")),
        # beyond every posture, so that none has to be tried
        ("robot.base_pose.position=[1e3, 0, 0]", ("start", "unreachable", "robot reaches")),
        # sensors and targets that are not there
        ("simulation.sensor_failure={time: 1, component: 12}", ("component", "12", "0 to 11")),
        ("targets.elastic.magic={bound: '< 1'}", ("magic", "max_path_deviation")),
    ],
)
def test_scenario_that_says_something_wrong(refused, mine, change, parts):
    refused(mine(), *parts, changes=[change])


def test_all_that_is_wrong_is_told(refused, mine):
    changes = [
        "controler.law=rigid",
        "duration=long",
        "reference.points=[0, ende]",
        "simulation.integrator=runge_kuta3",
        "start={offset: [0.01], rotation_deg: [1, 2]}",
    ]
    parts = (
        "6 things are wrong: (1) ",
        "unknown key 'controler'",
        "did you mean 'controller'?",
        "key 'duration' is 'long'",
        "key 'reference.points[1]' is 'ende': did you mean 'end'?",
        "start.offset = [0.01]; allowed: 2 finite numbers",
        "start.rotation_deg = [1.0, 2.0]; allowed: 3 finite numbers",
        "simulation.integrator = runge_kuta3",
        "did you mean 'runge_kutta3'?",
    )
    refused(mine(), *parts, changes=changes)


@pytest.mark.parametrize(
    ("written", "wrong", "message"),
    [
        # keys, types and values
        ("  law: elastic ", "  lwa: elastic ", "unknown key 'controller.lwa' = 'elastic': "),
        ("  velocity: 1.5", "  velocity: fast", "key 'reference.velocity' is 'fast': expected"),
        ("  law: elastic ", "  law: magic ", "controller.law = magic; allowed: velocity_servo, "),
        ("  offset: [0.010, 0.0]", "  offset: [0.01]", "start.offset = [0.01]; allowed: 2 finite"),
        # while the station is built
        (
            "      xi: {coefficients: [6250000, 500000, 15000, 200]}",
            "      xi: {poles: 5}",
            "controller.gains.elastic.xi.poles = [5.0]; allowed: 4 negative numbers (1/s)",
        ),
        (
            "  model: comau_racer_1_4_elastic_3r",
            "  model: comau",
            "robot.model: robot model 'comau'",
        ),
        ("  posture_deg: [15, 115, -10]", "  posture_deg: [15]", "start.posture_deg = [15.0]; "),
        ("  points: [0.96,", "  points: [x,", "key 'reference.points[0]' is 'x': expected"),
        ("  offset: [0.010, 0.0]", "  offset: [5.0, 0.0]", "start: "),
        (
            "  shape: !BentLemniscate {}",
            "  shape: !Waypoints {file: none.csv}",
            "path.shape.file: FOLDER/none.csv: No such file or directory",
        ),
        (
            "    max_path_deviation:",
            "    max_path_deviatio:",
            "targets.elastic.max_path_deviatio: ",
        ),
    ],
)
def test_the_line_is_named(refused, mine, tmp_path, written, wrong, message):
    file = Path(mine())
    text = file.read_text(encoding="utf-8")
    assert written in text
    file.write_text(text.replace(written, wrong, 1), encoding="utf-8")
    place = text[: text.index(written)].count("\n") + 1
    if message == "start: ":  # of the mapping
        place -= 1
    refused(file, f"error: {file}:{place}: {message.replace('FOLDER', str(tmp_path))}")


def test_lines_of_several_wrong_keys(refused, mine):
    file = Path(mine())
    lines = file.read_text(encoding="utf-8").splitlines()
    file.write_text("\n".join([*lines, "duratoin: 1", "hand: 3"]), encoding="utf-8")
    refused(
        file,
        f"error: {file}: 3 things are wrong: (1) line {len(lines) + 1}: unknown key 'duratoin' = 1",
        f"; (2) line {len(lines) + 2}: key 'hand' is 3: expected ",
        "; (3) --set start.offset=[1]: start.offset = [1.0]; allowed: 2 finite numbers",
        changes=["start.offset=[1]"],
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("controller.gains.elastic.eta.poles=5", "controller.gains.elastic.eta.poles = [5.0]; "),
        ("start.offset=[5.0, 0.0]", "start: "),
        ("path.orientation.convention=xyz", "path.orientation.convention = xyz; allowed: zyx, "),
        ("friction={file: none.yaml}", "friction.file: "),
    ],
)
def test_the_option_is_named(refused, mine, change, message):
    file = mine()
    text = Path(file).read_text(encoding="utf-8")
    Path(file).write_text(
        text.replace("eta: {coefficients: [6250000, 500000, 15000, 200]}", "eta: {}")
    )
    place = "\nstart:" in text and text[: text.index("\nstart:")].count("\n") + 2
    where = f":{place}" if message == "start: " else f": --set {change}"
    refused(file, f"error: {file}{where}: {message}", changes=[change])


@pytest.mark.parametrize(
    ("change", "nearest"),
    [
        ("controller.law=elatic", "elastic"),
        ("path.shape=!Waypoint {}", "!Waypoints"),
        ("path.shape=!circle {}", "!Circle"),
        ("robot.model=comau_racer_14", "comau_racer_1_4"),
        ("robot.tool_frame=toolpoint", "tool_point"),
        ("targets.elastic.max_path_deviaton={bound: '< 1'}", "max_path_deviation"),
    ],
)
def test_the_nearest_word_is_told(refused, mine, change, nearest):
    refused(mine(), f"did you mean '{nearest}'?", changes=[change])


@pytest.mark.parametrize("key", ["path.shape=!Waypoints {file: X}", "friction={file: X}"])
def test_the_nearest_file_is_told(refused, mine, tmp_path, key):
    (tmp_path / "points.csv").touch()
    parts = ("No such file or directory; did you mean 'points.csv'?",)
    refused(mine(), *parts, changes=[key.replace("X", "point.csv")])


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
        (
            "{poles: [-50, -50, -50, 1]}",
            ("eta.poles = [-50.0, -50.0, -50.0, 1.0]; allowed: 4 negative numbers (1/s)",),
        ),
        ("{poles: [-50, -50, -50, 0]}", ("eta.poles = [-50.0, ", "allowed: 4 negative")),
        ("{poles: 5}", ("eta.poles = [5.0]; allowed: 4 negative", "'elastic', or one for all")),
        (
            "{coefficients: [6250000, 500000, 15000, -200]}",
            ("eta.coefficients = ", "-200", "not Hurwitz", "allowed: "),
        ),
        # all positive, yet unstable
        (
            "{coefficients: [1, 1, 1, 1]}",
            ("eta.coefficients = [1.0, 1.0, 1.0, 1.0]: not Hurwitz, pole at ",),
        ),
        (
            "{coefficients: [6250000, 500000, 15000, 200], integral: 1e+9}",
            ("eta.coefficients = ", "with integral = 1e+09: not Hurwitz"),
        ),
        ("{poles: [-50, -50]}", ("eta.poles = [-50.0, -50.0]; allowed: 4 negative numbers",)),
        (
            "{coefficients: [900, 60]}",
            ("elastic.eta.coefficients = [900.0, 60.0]", "4 coefficients"),
        ),
        ("{}", ("controller.gains.elastic.eta: neither poles nor coefficients; allowed: 4 poles",)),
        ("{poles: [-1, -1, -1, -1], integral: 1}", ("poles", "either")),
        ("{poles: [-50, -50, -50, -.inf]}", ("eta.poles[3]", "-inf", "1/s")),
        (
            "{free: true, coefficients: [3]}",
            ("elastic.eta.coefficients = [3.0]; allowed: 3 poles",),
        ),
        ("{free: true, coefficients: [6, 11, -6]}", ("elastic.eta.coefficients", "not Hurwitz")),
        ("{free: true, poles: [-3, -4, -5], integral_pole: -1}", ("free", "integral_pole")),
    ],
)
def test_gains(refused, mine, gains, parts):
    refused(mine(), *parts, changes=[f"controller.gains.elastic.eta={gains}"])


def test_nothing_that_follows_a_moving_point_is_free(refused):
    gains = "controller.gains.singular_perturbation.eta={free: true, poles: [-5]}"
    refused("ttc_comau_6r", "eta.free = true", "trajectory", changes=[gains])


def test_no_gains_for_the_law(refused, mine):
    parts = ("controller.gains", "'visco_elastic'", "elastic, singular_perturbation, rigid")
    refused(mine(), *parts, changes=["controller.law=visco_elastic"])


def test_results_cannot_be_written(mine, tmp_path, capfd):
    (tmp_path / "file").write_text("x", encoding="utf-8")
    for out in (tmp_path / "file", tmp_path / "file" / "out"):
        capfd.readouterr()
        assert main(["run", mine(), "--out", str(out), "--duration", "0.02", *BARE]) == 2
        stderr = capfd.readouterr().err
        assert stderr.startswith("error: ")
        assert stderr.count("\n") == 1
        assert str(out) in stderr
