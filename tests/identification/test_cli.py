"""The command line from a robot to its model, on the robot with the fewest parameters."""

import csv
import json

import h5py
import numpy as np
import pytest

from identification.cli import main
from identification.model.dynamic_parameters import true_parameters
from identification.model.subject import load_subject
from pfsc_drake.robot.models.files import models_directory
from tests.one_process import short_experiments

ROBOT = "festo_expt_45"


@pytest.fixture(name="work", scope="module")
def fixture_work(tmp_path_factory):
    """Two runs of the shipped excitation, and what was estimated of them."""
    out = tmp_path_factory.mktemp("identification")
    with short_experiments():
        assert main(["simulate", ROBOT, "--runs", "2", "--out", str(out / "runs")]) == 0
    records = [str(out / "runs" / f"run_{seed}.h5") for seed in (1, 2)]
    assert main(["estimate", ROBOT, *records, "--simulated", "--out", str(out / "found")]) == 0
    return out


def metrics(folder):
    content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    return {name: metric["value"] for name, metric in content.items()}


@pytest.mark.slow
def test_what_was_estimated_can_be_checked_without_the_project(work):
    """Weighted least squares of the stored regressor, by numpy."""
    with h5py.File(work / "found" / "identification.h5") as file:
        Y, tau, weights = (file[name][:] for name in ("regressor", "torques", "weights"))
        found, sigma = file["base_parameters"][:], file["standard_deviation"][:]
        covariance = file["covariance"][:]
        names = [str(name) for name in file["base_parameters"].attrs["short_names"]]
        repeated = file["repetitions/base_parameters"][:]
    X, b = (weights[..., None] * Y).reshape(-1, len(found)), (weights * tau).ravel()
    solution = np.linalg.lstsq(X, b, rcond=None)[0]
    np.testing.assert_allclose(found, solution, rtol=1e-8)
    np.testing.assert_allclose(sigma, np.sqrt(np.diag(covariance)))
    subject = load_subject(ROBOT, tool=False)
    truth = true_parameters(subject)
    assert len(names) == len(truth) == 10
    assert np.abs((found - truth) / sigma).max() < 4.5
    np.testing.assert_allclose(repeated[0], found)


@pytest.mark.slow
def test_the_page_tells_what_was_found(work):
    found = metrics(work / "found")
    assert found["parameters"] == 10
    assert found["runs"] == 2
    assert found["truth_p_value"] > 1e-3
    page = (work / "found" / "report.html").read_text(encoding="utf-8")
    for words in ("Base parameters", "plate.m_y", "Physically consistent", "Autocorrelation"):
        assert words in page


@pytest.mark.slow
def test_the_model_is_written_and_can_be_read(work):
    out = work / "model"
    assert main(["consistent", ROBOT, str(work / "found"), "--out", str(out)]) == 0
    again = true_parameters(load_subject(str(out / "parameters.yaml"), tool=False))
    truth = true_parameters(load_subject(ROBOT, tool=False))
    np.testing.assert_allclose(again, truth, rtol=0.02)


@pytest.mark.slow
def test_the_page_can_be_written_again_with_the_robot_moving(work):
    excitation = models_directory() / ROBOT / "excitation_optimal.yaml"
    arguments = ["report", ROBOT, str(work / "found"), "--excitation", str(excitation)]
    validation = ["--validation", str(work / "runs" / "run_2.h5")]
    assert main([*arguments, *validation, "--out", str(work / "again")]) == 0
    page = (work / "again" / "report.html").read_text(encoding="utf-8")
    assert "excitation.html" in page
    assert (work / "again" / "excitation.html").stat().st_size > 100_000
    assert metrics(work / "again")["least_explained_not_used"] > 0.99


@pytest.mark.slow
def test_a_torque_with_the_wrong_sign_is_refused(work, tmp_path, capsys):
    file = tmp_path / "turned.h5"
    file.write_bytes((work / "runs" / "run_1.h5").read_bytes())
    with h5py.File(file, "r+") as record:
        record["tau"][:, 1] *= -1.0
        name = record["tau"].attrs["labels"][1]
    out = tmp_path / "found"
    assert main(["estimate", ROBOT, str(file), "--plain", "--out", str(out)]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert f"turned.h5: tau of {name} has the wrong sign" in error
    assert not out.exists()


@pytest.mark.slow
def test_an_excitation_is_found_and_written(tmp_path, capsys):
    out = tmp_path / "excitation"
    limits = ["--limit", "acceleration=30", "--harmonics", "1,2", "--period", "5"]
    assert main(["excite", ROBOT, *limits, "--starts", "1", "--out", str(out)]) == 0
    assert "log det" in capsys.readouterr().out
    rows = np.loadtxt(out / "excitation.csv", delimiter=",", comments=("#", "t"))
    assert rows.shape[1] == 10
    assert np.abs(rows[[0, -1], 4:]).max() < 1e-9  # from rest to rest


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["simulate", "no_robot"], ["no_robot"]),
        (["simulate", ROBOT, "--excitation", "missing.yaml"], ["missing.yaml"]),
        (["estimate", ROBOT, "missing.csv"], ["missing.csv"]),
        (["estimate", ROBOT, "record.txt"], ["record.txt", "suffix"]),
        (["estimate", ROBOT, "a.csv", "--unit", "q"], ["--unit", "NAME=VALUE"]),
        (["estimate", ROBOT, "a.csv", "--scale", "tau=x"], ["--scale", "a number"]),
        (["consistent", ROBOT, "missing.h5"], ["missing.h5"]),
        (["excite", ROBOT], ["acceleration"]),
        (["excite", ROBOT, "--limit", "speed=3"], ["speed"]),
        (["excite", ROBOT, "--seed", "-1"], ["--seed", "greater than or equal to 0"]),
        (["simulate", ROBOT, "--seed", "-1"], ["--seed", "greater than or equal to 0"]),
        (["excite", ROBOT, "--harmonics", "1,x", "--limit", "acceleration=30"], ["--harmonics"]),
    ],
)
def test_wrong_input_is_one_line(tmp_path, monkeypatch, capsys, arguments, parts):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    for part in parts:
        assert part in error


def test_log_det_of_the_printed_excitation(capsys):
    """Tab. C.2: 599.3 with 1,000 samples of a period."""
    assert main(["information", "comau_racer_1_4"]) == 0
    printed, shipped = capsys.readouterr().out.splitlines()
    assert printed.startswith("excitation.yaml: log det 599.3,") and "52 parameters" in printed
    assert shipped.startswith("excitation_optimal.yaml: log det 680.2,")


def test_motions_of_another_robot_have_no_information(capsys):
    assert main(["information", "comau_racer_1_4_3r"]) == 2
    line = capsys.readouterr().err
    assert "a motion of 6 joints; allowed: of 3, which comau_racer_1_4_3r has" in line


@pytest.mark.slow
def test_an_identification_of_another_robot_is_refused(work, tmp_path, capsys):
    out = str(tmp_path / "model")
    assert main(["consistent", "franka_emika_panda", str(work / "found"), "--out", out]) == 2
    assert "of festo_expt_45; must be of franka_emika_panda" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--total-mass", "5"], "--total-mass 5: allowed: LOW:HIGH"),
        (["--total-mass", "1:x"], "--total-mass x: allowed: a number"),
        (["--total-mass", "1:5"], "festo_expt_45: no chain of links"),
        (["--bounds", "missing.yaml"], "missing.yaml"),
    ],
)
def test_wrong_bounds_are_one_line(work, tmp_path, capsys, options, part):
    out = ["--out", str(tmp_path / "model")]
    assert main(["consistent", ROBOT, str(work / "found"), *options, *out]) == 2
    error = capsys.readouterr().err
    assert part in error and error.count("\n") == 1


@pytest.mark.slow
def test_elastic_joints_are_estimated_from_a_simulated_experiment(tmp_path, capsys):
    out, robot = tmp_path / "elastic", "comau_racer_1_4_elastic"
    assert main(["elastic", robot, "--locked", "--viscous", "0", "--out", str(out)]) == 0
    assert "stiffness" in capsys.readouterr().out
    found = {}
    with (out / "elastic_joints.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found.setdefault(row["parameter"], []).append(float(row["value"]))
    chain = load_subject(robot).chain
    np.testing.assert_allclose(found["stiffness"], chain.K_s, rtol=3e-3)
    np.testing.assert_allclose(found["inertia"], chain.D_M, rtol=5e-3)
    # a file from elsewhere gives the same
    again = ["elastic", robot, str(out / "record.h5"), "--locked", "--out", str(tmp_path / "b")]
    assert main(again) == 0
    text = [(folder / "elastic_joints.csv").read_text() for folder in (out, tmp_path / "b")]
    assert text[0] == text[1]
