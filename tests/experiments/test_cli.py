"""Command line: exit status, streams and messages; the simulation itself is replaced."""

import collections
import json
import subprocess
import sys
import types
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import typer

import identification.cli
from experiments import cli
from experiments.cli import main
from experiments.scenario_file import CatalogEntry
from pfsc_drake import InputError
from reporting.metrics import Metrics
from reporting.provenance import PROJECT_ROOT


@dataclass
class Outcome:
    """What a run hands back."""

    fault: str | None = None
    report: Path | None = Path("somewhere/report.html")
    metrics: Metrics = field(default_factory=Metrics)
    warnings: list[str] = field(default_factory=list)
    interrupted: bool = False
    problem: str | None = None
    margins: str | None = None
    broken: list[str] = field(default_factory=list)
    stop: str = ""


class FakeRun:
    """Stands in for ``experiments.simulated_run``: remembers the call, does what it is told."""

    def __init__(self) -> None:
        self.outcome = Outcome()
        self.raises: BaseException | None = None
        self.calls: list[tuple] = []
        self.warns: list[str] = []

    def run_scenario(self, scenario, out, options, progress, warn):
        self.calls.append((scenario, out, options.duration, options.figures, options.recording))
        progress(0.0, "building")
        for sentence in self.warns:
            warn(sentence)
        progress.expect(1.0)
        for step in range(11):
            progress(0.1 * step, "simulating")
        if self.raises is not None:
            raise self.raises
        return self.outcome


@pytest.fixture
def fake_run(monkeypatch):
    fake = FakeRun()
    module = types.ModuleType("experiments.simulated_run")
    module.run_scenario = fake.run_scenario
    options = ("duration", "after_fault", "margins", "figures", "recording")
    module.RunOptions = collections.namedtuple("RunOptions", options)
    monkeypatch.setitem(sys.modules, "experiments.simulated_run", module)
    return fake


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "my_run.yaml"
    path.write_text("name: my_run\nsection: 3.8.3\ndescription: Test\n")
    return path


def error_line(capsys) -> str:
    """The one line on stderr."""
    stderr = capsys.readouterr().err
    assert stderr.count("\n") == 1
    assert stderr.endswith("\n")
    return stderr


def test_completed_run(fake_run, scenario, tmp_path, capsys):
    fake_run.outcome.metrics.add("max_path_deviation", 4.3e-5, "m", "< 0.05e-3")
    fake_run.outcome.metrics.add("real_time_factor", 4.0, "1", ">= 5")
    out = tmp_path / "out"
    assert main(["run", str(scenario), "--out", str(out)]) == 0
    ((loaded, used_out, duration, figures, recording),) = fake_run.calls
    assert (loaded.name, loaded.path) == ("my_run", scenario)
    assert (used_out, duration, figures, recording) == (out, None, True, True)
    captured = capsys.readouterr()
    assert captured.err == ""
    lines = captured.out.splitlines()
    assert lines[-1] == "Open the report: somewhere/report.html"
    (row,) = [line for line in lines if "max_path_deviation" in line]
    assert row.split()[1:] == ["43", "µm", "<", "50", "µm", "met"]
    (row,) = [line for line in lines if "real_time_factor" in line]
    assert row.split()[-1] == "missed"


def test_options_reach_the_run(fake_run, scenario):
    arguments = ["--duration", "0.5", "--no-figures", "--no-recording"]
    overrides = ["--set", "controller.law=rigid", "--set", "a.b=[1, 2]"]
    assert main(["run", str(scenario), *arguments, *overrides]) == 0
    ((loaded, out, duration, figures, recording),) = fake_run.calls
    assert (out, duration, figures, recording) == (Path("out/my_run"), 0.5, False, False)
    assert loaded.data["controller"] == {"law": "rigid"}
    assert loaded.data["a"] == {"b": [1, 2]}


def test_progress_in_plain_lines(fake_run, scenario, capsys):
    main(["run", str(scenario)])
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("my_run:")]
    assert lines[:2] == ["my_run: building", "my_run: simulating"]
    assert [line.split()[2] for line in lines[2:]] == [f"{0.1 * i:.2f}" for i in range(1, 11)]
    assert "of 1.00 s" in lines[-1]
    assert "x real time" in lines[-1]


def test_fault(fake_run, scenario, tmp_path, capsys):
    fake_run.outcome.fault = "left the feasible\nneighbourhood"
    assert main(["run", str(scenario), "--out", str(tmp_path / "out")]) == 3
    line = error_line(capsys)
    assert line.startswith("fault: left the feasible neighbourhood; ended at t = 1.000 s,")
    fake_run.outcome.stop = "still moving at t = 1.000 s, joint 2 at 0.3 rad/s"
    assert main(["run", str(scenario), "--out", str(tmp_path / "out")]) == 3
    assert "; still moving at t = 1.000 s, joint 2 at 0.3 rad/s, " in error_line(capsys)
    assert f"log written to {tmp_path / 'out'}" in line


def test_input_error_of_the_run(fake_run, scenario, capsys):
    fake_run.raises = InputError("my_run.yaml: key 'law'\n is wrong")
    assert main(["run", str(scenario)]) == 2
    assert error_line(capsys) == "error: my_run.yaml: key 'law' is wrong\n"


def test_interrupt(fake_run, scenario, capsys):
    fake_run.raises = KeyboardInterrupt()
    assert main(["run", str(scenario)]) == 130
    assert error_line(capsys) == "interrupted\n"


def test_a_broken_promise_is_the_last_word(fake_run, scenario, capsys):
    fake_run.outcome.broken = ["deepest_violation = 65 mm, target <= 500 µm"]
    assert main(["run", str(scenario)]) == 3
    assert error_line(capsys).startswith("missed: deepest_violation = 65 mm, target <= 500 µm, ")
    fake_run.outcome.fault = "singular"
    assert main(["run", str(scenario)]) == 3
    assert "; missed: deepest_violation = 65 mm" in error_line(capsys)


def test_interrupted_run_that_is_kept(fake_run, scenario, tmp_path, capsys):
    fake_run.outcome.interrupted = True
    assert main(["run", str(scenario), "--out", str(tmp_path / "out")]) == 130
    line = error_line(capsys)
    assert line.startswith("interrupted at t = 1.000 s, log written to")


@pytest.mark.parametrize("fault", [None, "singular"])
def test_results_that_could_not_be_written(fake_run, scenario, capsys, fault):
    fake_run.outcome.problem = "cannot write log.h5 into out: No space left on device; lost"
    fake_run.outcome.report, fake_run.outcome.fault = None, fault
    assert main(["run", str(scenario)]) == 4
    captured = capsys.readouterr()
    assert "Open the report" not in captured.out
    assert captured.err.count("\n") == 1
    assert "error: cannot write log.h5 into out: No space left on device; lost" in captured.err
    assert ("fault: singular" in captured.err) == (fault is not None)
    assert "log written to" not in captured.err


def test_home_is_found(fake_run, scenario, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["run", "~/my_run.yaml", "--out", "~/results"]) == 0
    ((loaded, out, *_),) = fake_run.calls
    assert (loaded.path, out) == (scenario, tmp_path / "results")


def test_other_exceptions_are_not_hidden(fake_run, scenario):
    fake_run.raises = ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        main(["run", str(scenario)])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Missing command"),
        (["frob"], "frob"),
        (["run"], "scenario"),
        (["run", "FILE", "--bogus"], "--bogus"),
        (["run", "FILE", "--duration", "abc"], "--duration"),
        (["run", "FILE", "--duration", "0"], "--duration 0: allowed: a positive number"),
        (["run", "FILE", "--duration", "inf"], "--duration inf: allowed"),
        (["run", "FILE", "--set", "a"], "--set a: malformed"),
        (["run", "FILE", "--duration", "1_0"], "--duration 1_0: allowed"),
        (["run", "FILE", "--duration", "\u0661"], "--duration \u0661: allowed"),
        (["run", "FILE", "--duration", "1e400"], "--duration 1e400: allowed"),
        (["run", "FILE", "--out", "~nobody_has_this_name/x"], "no home folder is known for ~nob"),
        (["run", "~nobody_has_this_name/x.yaml"], "no home folder is known for ~nobody"),
        (["run", "none.yaml"], "scenario file none.yaml: no such file"),
        (["run", "identify_coma"], "did you mean 'identify_comau'?"),
        (["study", "robustnes"], "study robustnes: allowed: robustness, fastest"),
        (["study", "robustnes"], "did you mean 'robustness'?"),
        (["rnu", "FILE"], "Did you mean 'run'?"),
        (["run", "zzz"], "unknown scenario 'zzz'"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(fake_run, scenario, capsys, arguments, message):
    arguments = [str(scenario) if argument == "FILE" else argument for argument in arguments]
    assert main(arguments) == 2
    line = error_line(capsys)
    assert line.startswith("error: ")
    assert message in line
    assert fake_run.calls == []


def test_every_command_has_an_example_that_it_accepts():
    group = typer.main.get_command(cli.app)
    commands = {n: c for n, c in group.commands.items() if not hasattr(c, "commands")}
    assert len(commands) > 10
    for name, command in commands.items():
        program, word, *words = command.epilog.removeprefix("Example: ").strip("`").split()
        assert (program, word) == ("pfsc", name)
        command.make_context(name, words)  # reads them, and runs nothing


def _with_out(group, words=()):
    """Yield the words of all commands that have an option --out."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _with_out(command, (*words, name))
        elif any("--out" in parameter.opts for parameter in command.params):
            assert all(p.opts == ["--out"] for p in command.params if "--out" in p.opts)
            yield (*words, name)


@pytest.mark.parametrize("program", [main, identification.cli.main])
def test_a_folder_without_a_name_is_refused_by_every_command(program, capsys):
    app = {main: cli.app, identification.cli.main: identification.cli.app}[program]
    commands = list(_with_out(typer.main.get_command(app)))
    assert len(commands) > 4
    for words in commands:
        for out in (("--out", ""), ("--out=",)):
            assert program([*words, *out]) == 2
            error = "error: --out '': no name of a folder; allowed: a folder, '.' for this one\n"
            assert capsys.readouterr().err == error


def test_a_file_with_nearly_that_name(scenario, capsys):
    assert main(["run", str(scenario.with_name("my_rum.yaml"))]) == 2
    assert error_line(capsys).endswith("my_rum.yaml: no such file; did you mean 'my_run.yaml'?\n")


def test_quietly_only_the_last_line(fake_run, scenario, capsys):
    fake_run.outcome.metrics.add("max_path_deviation", 4.3e-5, "m", "< 0.05e-3")
    fake_run.outcome.warnings = ["the joints resonate too fast"]
    assert main(["run", str(scenario), "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.out == "Open the report: somewhere/report.html\n"
    assert captured.err == ""


def test_quietly_errors_too(fake_run, scenario, capsys):
    fake_run.outcome.fault = "singular"
    assert main(["run", str(scenario), "--quiet"]) == 3
    captured = capsys.readouterr()
    assert captured.out == "Open the report: somewhere/report.html\n"
    assert captured.err.startswith("fault: singular; ended at t = ")
    assert main(["run", "none.yaml", "--quiet"]) == 2
    assert error_line(capsys).startswith("error: scenario file none.yaml: no such file")


def test_a_quiet_sweep(monkeypatch, capsys):
    from experiments.sweep import sweep

    def run_sweep(_, out, console, **__):
        console.print("half of it")
        return sweep.SweepOutcome(
            out / "report.html",
            {},
            0,
            {"strange": "run x"},
            {},
            ["w"],
            False,
            None,
            None,
        )

    made = types.SimpleNamespace(scenario=types.SimpleNamespace(name="many"))
    monkeypatch.setattr(sweep, "define_sweep", lambda *_, **__: made)
    monkeypatch.setattr(sweep, "run_sweep", run_sweep)
    assert main(["sweep", "many", "--quiet"]) == 0
    assert capsys.readouterr().out == "Open the report: out/many_sweep/report.html\n"
    assert main(["sweep", "many"]) == 0
    assert {"half of it", "warning: w"} < {*capsys.readouterr().out.splitlines()}


@pytest.mark.parametrize("command", ["run", "sweep", "study", "drive"])
def test_commands_that_can_be_quiet(command, capsys):
    assert main([command, "--help"]) == 0
    assert "--quiet" in capsys.readouterr().out


def test_list(monkeypatch, scenario, capsys):
    entries = [CatalogEntry("my_run", "3.8.3", "Test [brackets]")]
    monkeypatch.setattr("experiments.run_commands.list_scenarios", lambda: entries)
    assert main(["list"]) == 0
    assert capsys.readouterr().out.splitlines()[1].split() == [
        "my_run",
        "3.8.3",
        "Test",
        "[brackets]",
    ]
    assert main(["list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [
        {"name": "my_run", "section": "3.8.3", "description": "Test [brackets]"}
    ]


def test_list_of_signals(capsys):
    assert main(["list", "--signals"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:2] == ["Signal", "Unit"]
    assert any(line.startswith("manifold_force ") and " N, Nm " in line for line in lines)
    assert main(["list", "--signals", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert list(listed) == ["signals", "metrics", "figures"]
    assert "settling_time" in [metric["name"] for metric in listed["metrics"]]


def run_process(*arguments: str, code: str | None = None) -> subprocess.CompletedProcess:
    command = ["-c", code] if code else ["-m", "experiments"]
    return subprocess.run(
        [sys.executable, *command, *arguments], cwd=PROJECT_ROOT, capture_output=True, text=True
    )


@pytest.mark.slow
def test_module_exits_with_the_status():
    result = run_process("run", "no_such_scenario")
    assert result.returncode == 2
    assert result.stderr.startswith("error: unknown scenario 'no_such_scenario'")
    assert run_process("--help").returncode == 0


def test_listing_stays_light():
    """What makes a start slow must not be imported for ``list``."""
    code = (
        "import sys; from experiments.cli import main; main(['list']);"
        "heavy = {'pydrake', 'casadi', 'matplotlib', 'h5py', 'scipy'} & set(sys.modules);"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    result = run_process(code=code)
    assert result.returncode == 0, result.stderr


def test_a_warning_is_printed_and_does_not_fail_the_run(fake_run, scenario, capsys):
    fake_run.outcome.warnings = ["the joints resonate too fast"]
    assert main(["run", str(scenario)]) == 0
    assert "warning: the joints resonate too fast" in capsys.readouterr().out


def test_the_identification_runs_by_its_name(monkeypatch, tmp_path, capsys):
    from experiments.studies import identify
    from reporting.page import Report

    seen = []

    def write(out, progress):
        seen.append(out)
        progress("one line")
        return Report(out / "report.html", None)

    monkeypatch.setattr(identify, "write_identification", write)
    assert main(["run", "identify_comau", "--out", str(tmp_path / "found")]) == 0
    assert seen == [tmp_path / "found"]
    assert "one line" in capsys.readouterr().out
    arguments = ["identify_comau", "--out", str(tmp_path / "found"), "--quiet"]
    for command in ("run", "study"):
        assert main([command, *arguments]) == 0
        assert capsys.readouterr().out == f"Open the study: {tmp_path}/found/report.html\n"


def test_warnings_come_before_anything_moves(fake_run, scenario, capsys):
    """Those that are known beforehand once, before the metrics; others after them."""
    fake_run.warns = ["the joints resonate too fast"]
    fake_run.outcome.warnings = [*fake_run.warns, "the tool was far from its path"]
    assert main(["run", str(scenario)]) == 0
    out = capsys.readouterr().out
    places = [out.index(words) for words in ("resonate", "simulating", "Metric", "was far from")]
    assert places == sorted(places)
    assert out.count("resonate") == 1
