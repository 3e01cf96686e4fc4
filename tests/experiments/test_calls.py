"""Runs from scripts and notebooks: the same as of the command line, and what is said of them."""

import gc
import html
import subprocess
import sys
import types

import h5py
import numpy as np
import pytest

import experiments
from experiments import Scenario, load, margins, run
from pfsc_drake import InputError
from reporting.provenance import PROJECT_ROOT

CHANGES = {"controller.law": "rigid", "start.transition": 0}


@pytest.fixture(scope="module")
def short():
    """A run of a fifth of a second, without figures and recording."""
    return run("pfc_elastic_3r", CHANGES, duration=0.2, figures=False, recording=False, quiet=True)


@pytest.fixture
def notebook(monkeypatch):
    """Pretend to be in a notebook; return what it was told to show."""
    shown = []

    class Handle:
        def update(self, content, raw):
            assert raw
            shown.append(content["text/html"])

    def display(content, raw, display_id=False):
        assert raw
        shown.append(content["text/html"])
        return Handle() if display_id else None

    shell = type("ZMQInteractiveShell", (), {})()
    python = types.ModuleType("IPython")
    python.get_ipython, python.version_info = lambda: shell, (9, 0)
    python.display = types.ModuleType("IPython.display")
    python.display.display = display
    monkeypatch.setitem(sys.modules, "IPython", python)
    monkeypatch.setitem(sys.modules, "IPython.display", python.display)
    return shown


def test_a_run_is_that_of_the_command_line(short, run_scenario, tmp_path):
    changes = [x for key, value in CHANGES.items() for x in ("--set", f"{key}={value}")]
    same = run_scenario(tmp_path / "out", "pfc_elastic_3r", "--duration", "0.2", *changes)
    np.testing.assert_array_equal(short.log.time, same.t)
    assert set(short.log.signals) == set(same.log) - {"t"}
    for name, signal in short.log.signals.items():
        np.testing.assert_array_equal(signal.values, same[name], err_msg=name)
        assert signal.unit == same.marks[name]["unit"]
    assert short.log["xi"].labels == ["xi_1", "xi_2"]
    assert set(short.metrics) == set(same.metrics)


def test_an_ended_run_has_no_fault(short):
    assert (short.fault, short.missed, short.interrupted) == (None, [], False)
    assert short.metrics["controller_tick_us"].unit == "us"
    assert short.report.is_file()
    assert short.figures == {}


def test_importing_the_package_loads_no_library():
    code = (
        "import sys, experiments; experiments.__all__;"
        "print([m for m in ('pydrake', 'matplotlib', 'h5py', 'numpy') if m in sys.modules])"
    )
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=PROJECT_ROOT, capture_output=True, text=True, check=True
    )
    assert told.stdout == "[]\n"


@pytest.mark.parametrize("name", experiments.__all__)
def test_whatever_is_announced_is_there(name):
    assert getattr(experiments, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'runs'"):
        experiments.runs  # noqa: B018


@pytest.mark.slow
def test_a_scenario_made_in_python_runs_again(short):
    scenario = short.scenario
    assert isinstance(scenario, Scenario)
    scenario.controller.gains["rigid"].xi.coefficients = [400.0, 40.0]
    again = run(scenario, duration=0.05, figures=False, recording=False, quiet=True)
    assert again.name == "pfc_elastic_3r"
    assert again.scenario.controller.gains["rigid"].xi.coefficients == [400.0, 40.0]
    np.testing.assert_array_equal(again.log["q_J"].values[0], short.log["q_J"].values[0])
    assert abs(again.log["tau_d"].values[0] - short.log["tau_d"].values[0]).max() > 0.1  # Nm


@pytest.mark.slow
def test_changes_of_python_and_of_text(mine):
    changes = CHANGES | {
        "reference.points": np.array([0.1, 0.101]),
        "start.offset": (0, np.float64(0.0)),
        "path.shape": "!Circle {radius: 0.1}",
        "targets": {},
    }
    short = run(mine(), changes, duration=0.01, figures=False, recording=False, quiet=True)
    assert short.scenario.reference.points == [0.1, 0.101]
    assert short.scenario.path.shape.radius == 0.1
    assert short.name == "pfc_elastic_3r"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scenario": "pfc_elastic_3"}, "unknown scenario 'pfc_elastic_3': did you mean"),
        ({"duration": -1.0}, "duration = -1.0; allowed: a positive number of seconds"),
        ({"duration": float("nan")}, "duration = nan; allowed"),
        ({"after_fault": -0.1}, "after_fault = -0.1; allowed: a number of seconds, 0 or more"),
        ({"changes": {"controller.lwa": "rigid"}}, "lwa"),
        ({"changes": {"controller..law": "rigid"}}, "malformed; allowed: key.path=value"),
        ({"changes": {"controller.law": {1, 2}}}, "of type set; allowed: text, numbers"),
        ({"changes": {"duration": [[[[object()]]]]}}, "of type object; allowed"),
    ],
)
def test_wrong_arguments(arguments, message):
    given = {"scenario": "pfc_elastic_3r", "quiet": True, **arguments}
    with pytest.raises(InputError) as caught:
        run(**given)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_fault_is_told_and_kept(tmp_path):
    faulty = run(
        "pfc_elastic_3r",
        CHANGES | {"simulation.sensor_failure": {"time": 0.01, "component": 0}},
        duration=0.2,
        out=tmp_path / "out",
        figures=False,
        recording=False,
        quiet=True,
    )
    assert faulty.fault is not None
    assert faulty.log.time[-1] < 0.2
    again = load(tmp_path / "out")
    assert again == faulty
    assert f"fault: {faulty.fault.split()[0]}" in again._repr_html_()


@pytest.mark.slow
def test_a_temporary_folder_is_gone_with_its_run():
    result = run(
        "pfc_elastic_3r", CHANGES, duration=0.01, figures=False, recording=False, quiet=True
    )
    folder = result.folder
    assert folder.is_dir()
    del result
    gc.collect()
    assert not folder.exists()


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_figures_and_recording_are_shown(tmp_path, notebook, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("pfc_elastic_3r", CHANGES, duration=0.05, out="runs/mine")
    line = [text for text in notebook if "simulating" in text]
    assert line
    assert "<progress" in line[0]
    assert notebook[-1] == ""
    assert capsys.readouterr().out == ""
    assert "transversal" in result.figures
    picture, meta = result.figures["transversal"]._repr_png_()
    assert picture.startswith(b"\x89PNG")
    assert meta["width"] > 0
    assert result.figures["transversal"].caption
    result.show(height=300)
    assert 'src="runs/mine/recording.html"' in notebook[-1]
    assert 'loading="lazy"' in notebook[-1]
    assert "height: 300px" in notebook[-1]
    monkeypatch.chdir("runs/mine/figures")
    result = load(tmp_path / "runs" / "mine")
    result.show()
    assert 'srcdoc="' in notebook[-1]
    assert len(notebook[-1]) > 500_000
    monkeypatch.delitem(sys.modules, "IPython")
    result.show()
    assert capsys.readouterr().out.strip() == str(tmp_path / "runs" / "mine" / "recording.html")


def test_nothing_recorded_cannot_be_shown(short):
    with pytest.raises(InputError, match=r"recording\.html: no such file"):
        short.show()


def test_a_short_table(short):
    table = short._repr_html_()
    assert "<b>pfc_elastic_3r</b>: completed" in table
    assert "more metrics" in table
    for name in short.metrics:
        assert f"<code>{name}</code>" in table
    judged = load(short.folder)
    judged.metrics["real_time_factor"].target = "> 0"
    shown, folded = judged._repr_html_().split("<details>")
    assert "real_time_factor" in shown
    assert "✓ met" in shown
    assert "real_time_factor" not in folded


def test_saving_and_loading(short, tmp_path):
    kept = short.save(tmp_path / "kept")
    assert kept.folder == tmp_path / "kept"
    assert (kept.fault, kept.warnings, kept.missed) == (short.fault, short.warnings, short.missed)
    assert kept.metrics == short.metrics
    names = sorted(path.name for path in short.folder.iterdir())
    assert sorted(path.name for path in kept.folder.iterdir()) == names
    with h5py.File(kept.folder / "log.h5") as file:
        np.testing.assert_array_equal(file["xi"][:], short.log["xi"].values)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "log.h5").write_text("mine")
    with pytest.raises(InputError, match=r"holds log\.h5, which no run has written"):
        short.save(tmp_path / "mine")
    assert (tmp_path / "mine" / "log.h5").read_text() == "mine"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such folder; allowed: the folder of a run"),
        ({}, "holds no results; allowed: the folder of a run"),
        (
            {"manifest.json": '{"program": "pfsc_drake", "results": "sweep", "files": []}'},
            "holds the results of a sweep; allowed: the folder of a run",
        ),
        ({"manifest.json": "{"}, "holds no results"),
    ],
)
def test_folders_without_a_run(tmp_path, content, message):
    folder = tmp_path / "folder"
    for name, text in (content or {}).items():
        folder.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    if content is not None:
        folder.mkdir(exist_ok=True)
    with pytest.raises(InputError) as caught:
        load(folder)
    assert str(caught.value) == f"{folder}: {message}" or message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_runs_from_before_tell_no_outcome(short, tmp_path):
    kept = short.save(tmp_path / "kept")
    text = '{"program": "pfsc_drake", "results": "run", "files": ["log.h5", "metrics.json"]}'
    (kept.folder / "manifest.json").write_text(text)
    old = load(kept.folder)
    assert (old.fault, old.warnings) == (None, [])


def test_a_table_of_pandas(short):
    table = short.to_dataframe()
    np.testing.assert_array_equal(table.index, short.log.time)
    assert table.index.name == "t"
    assert list(table["xi"].columns) == ["xi_1", "xi_2"]
    np.testing.assert_array_equal(table["xi"].to_numpy(), short.log["xi"].values)
    assert set(table["fault", "fault"]) == {"none"}
    assert table.attrs["units"]["xi"] == "m"


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_margins():
    told = margins(
        "pfc_elastic_3r", {"reference.points": [0.96, 0.9]}, stiffness=0.0, tool=0.0, quiet=True
    )
    assert told.is_stable
    assert told.is_robust
    assert told.metrics["slowest_rate"].value == told.analysis.nominal.worst.rate < 0.0
    assert {str(case.error) for case in told.analysis.singles} == {
        "nominal masses 5 % too low",
        "nominal masses 5 % too high",
    }
    assert told.figures["modes"].png.startswith(b"\x89PNG")
    assert told.sentences[0] in html.unescape(told._repr_html_())
    with pytest.raises(InputError, match=r"--mass 2: allowed: 0 or a fraction below 1"):
        margins("pfc_elastic_3r", mass=2.0, quiet=True)
