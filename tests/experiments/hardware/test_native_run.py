"""The loop in C against its description in Python, to the last bit, whatever the robot tells."""

import shutil
import subprocess
import time

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from experiments.hardware.native_record import Event, NativeRun, RepeatedDrive
from experiments.hardware.native_run import Operator, run_native
from experiments.results.run_signals import collect_log
from pfsc_drake.drivers.layout import UdpmAddress
from pfsc_drake.drivers.link import ObserverEndpoint, RequestEndpoint
from pfsc_drake.drivers.messages import RobotMode, dialect
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.errors import InputError
from tests.compilers import needs_gcc
from tests.experiments.hardware.native_bench import Bench, changed, quiet

PANDA = ["start.transition=0.15", "reference.dwell=0.15"]
FROM_TORQUE = [
    *("encoders.sides=motor_and_torque", "controller.state=from_torque", "driver.delay=0.001"),
    *("reference.velocity=0.5", "start.transition=0.3"),
]
ADDRESS = UdpmAddress.of("udpm://")


@pytest.fixture(scope="module", name="panda")
def fixture_panda(tmp_path_factory):
    return Bench(tmp_path_factory.mktemp("panda") / "native", "pfc_panda_7r", PANDA)


@pytest.fixture(scope="module", name="told")
def fixture_told(panda):
    """0.5 s, of which 0.2 s on the path."""
    return panda.statuses(0.5)


@pytest.mark.slow
@needs_gcc
def test_all_that_comes_is_answered_alike(panda, told):
    run, repeated = panda.answer(panda.rows(told))
    assert (run.reason, len(run.rows)) == ("record", 500)
    assert repeated.first is None
    assert repeated.result.fault is None
    assert np.ptp(run.rows["sent"], axis=0).max() > 1.0
    log = collect_log(panda.prepared.station, repeated.result.root)
    repeated.add_to(log)
    np.testing.assert_array_equal(log["sent"].values, run.rows["sent"])
    assert not log["sent_difference"].values.any()


@pytest.mark.slow
@needs_gcc
def test_lost_packets_and_what_comes_twice(panda, told):
    random = np.random.default_rng(1)
    left = [x for k, x in enumerate(told) if k == 0 or random.random() > 0.08]
    left[300:300] = left[290:295]
    run, repeated = panda.answer(panda.rows(left))
    assert repeated.first is None
    assert repeated.result.fault is None
    assert 20 < run.rows["missed"].sum() == 499 - (len(run.rows) - 1)
    assert len(run.rows) == len(left) - 5
    assert run.rows["missed"].max() > 1
    ticks = repeated.drive.ticks
    assert len(ticks) == 500
    assert sum(tick.missed for tick in ticks if not np.isnan(tick.age)) == run.rows["missed"].sum()


@pytest.mark.slow(
    but=[
        "<lambda>-not a finite numb-record",
        "<lambda>-the robot went into mode REFLEX-mode",
        "<lambda>-no status of the robot for 30 ms-faster",
    ]
)
@needs_gcc
@pytest.mark.parametrize(
    ("change", "fault", "reason"),
    [
        (lambda s: {"q": s.q + 0.05 * (np.arange(7) == 3)}, "joint 4 jumped by 2.8", "faster"),
        (lambda s: {"q": np.where(np.arange(7) == 2, np.nan, s.q)}, "not a finite numb", "faster"),
        (lambda s: {"v": np.where(np.arange(7) == 2, np.inf, s.v)}, "not a finite numb", "faster"),
        (lambda s: {"v": np.where(np.arange(7) == 2, np.nan, s.v)}, "not a finite numb", "record"),
        (lambda s: {"robot_mode": RobotMode.REFLEX}, "the robot went into mode REFLEX", "mode"),
        (lambda s: {"utime": s.utime + 1_500_000}, "the robot's clock jumped by 1.5 s", "clock"),
        (lambda s: {"utime": s.utime + 30_000}, "no status of the robot for 30 ms", "faster"),
    ],
)
def test_what_ends_it(panda, told, change, fault, reason):
    """These statuses are of a robot that goes on, faster, however it is to stop."""
    run, repeated = panda.answer(panda.rows(changed(told, 250, change)))
    assert repeated.first is None, repeated.warnings
    assert fault in repeated.result.fault
    assert run.reason == reason
    assert np.isfinite(run.rows["sent"]).all()
    assert len(run.rows) >= 251


@needs_gcc
def test_the_pace_changes_alike(panda, told):
    """Also from the start; the end comes later, in the time of the motion as planned."""
    _, repeated = panda.answer(panda.rows(told, overrides={0: 0.6, 200: 0.0, 280: 1.3}))
    assert repeated.first is None, repeated.warnings
    drive = repeated.drive
    assert drive.time == pytest.approx(0.5)
    assert 0.1 < drive.motion_time < 0.45
    assert [drive.ticks[k].override for k in (0, 250, 450)] == [0.6, 0.0, 1.3]


@needs_gcc
def test_a_stop_that_makes_the_robot_faster_ends_alike(panda, told):
    faster = changed(told, 400, lambda s: {"v": s.v * 3.0, "utime": s.utime})
    run, repeated = panda.answer(panda.rows(faster, {390: Event.REQUESTED}))
    assert repeated.first is None, repeated.warnings
    assert run.reason == "faster"
    assert "stop requested; the stop accelerated the robot" in repeated.result.fault
    assert len(run.rows) == 401


@needs_gcc
def test_torques_that_are_asked_for_too_fast_are_clipped_alike(panda, told):
    random = np.random.default_rng(2)
    told = changed(told, 200, lambda s: {"v": s.v + 0.05 * random.normal(size=7)}, 240)
    run, repeated = panda.answer(panda.rows(told))
    assert repeated.first is None
    assert run.rows["clipped"][200:240].any()


def stands(status, ticks):
    """Return what is changed in the status of a robot that stands for some ticks."""
    return {"v": 0.0 * status.v, "utime": status.utime + 1000 * ticks}


@pytest.mark.slow(but="4-its record could not be written")
@needs_gcc
@pytest.mark.parametrize(
    ("event", "said"),
    [
        (Event.INTERRUPTED, "interrupted"),
        (Event.ALONE, "the controller's parent process has ended"),
        (Event.UNRECORDED, "its record could not be written"),
        (Event.FOREIGN, "another sender commands the robot"),
    ],
)
def test_a_stop_ends_when_the_robot_has_rested(panda, told, event, said):
    standing = [
        *told[:250],
        *(changed(told[250:251], 0, lambda s, k=k: stands(s, k))[0] for k in range(400)),
    ]
    run, repeated = panda.answer(panda.rows(standing, {200: event}))
    assert repeated.first is None
    assert repeated.result.fault == said
    assert run.reason == "rested"
    assert 400 < len(run.rows) < 500


@needs_gcc
def test_who_differs_is_found_out(panda, told):
    run, _ = panda.answer(panda.rows(told[:200]))
    rows = run.rows.copy()
    rows["sent"][120, 2] = np.nextafter(rows["sent"][120, 2], np.inf)
    repeated = RepeatedDrive(NativeRun(rows, "record"), panda.make_drive, panda.dialect, quiet)
    assert repeated.first == pytest.approx(0.12)
    [warning] = repeated.warnings
    assert "differ at 1 ticks, first at t = 0.120 s, by" in warning
    rows["missed"][150] = 3
    repeated = RepeatedDrive(NativeRun(rows, "record"), panda.make_drive, panda.dialect, quiet)
    assert repeated.ticks == 2


STUB = """
#include <math.h>
#include <string.h>
#include "controller.h"
void controller_initialize(controller_state *state, const controller_inputs *inputs)
{
    (void)inputs;
    state->tick = 0.0;
}
int controller_step(
    controller_state *state, const controller_inputs *inputs, controller_outputs *outputs)
{
    memset(outputs, 0, sizeof *outputs);
    outputs->drive_torque[1] = (state->tick += 1.0) > 5.0 ? NAN : 0.0;
    return inputs->stop_request[0] != 0.0;
}
"""


@needs_gcc
def test_what_is_no_number_is_not_sent(panda, told):
    """Also not if the controller wants it."""
    panda.program  # noqa: B018
    (panda.folder / "stub").write_text(STUB)
    loop = ["drive_lcm", "recorder", "drive", "messages", "drive_setup", "robot_weight"]
    objects = [f"{name}.o" for name in (*loop, "robot_tables")]
    command = ["gcc", "-std=c99", "-o", "stubbed", "-x", "c", "stub", "-x", "none", *objects]
    subprocess.run([*command, "-lm", "-pthread"], cwd=panda.folder, check=True)
    rows = panda.rows(told[:20])
    run, _ = panda.answer(rows, panda.folder / "stubbed")
    assert run.reason == "not_finite"
    assert len(run.rows) == 6
    assert np.isfinite(run.rows["sent"][:5]).all()


@pytest.mark.slow
@needs_gcc
def test_an_iiwas_messages_do_as_well(panda, tmp_path):
    """And nothing is compiled again but what knows of messages."""
    panda.program  # noqa: B018
    shutil.copytree(panda.folder, tmp_path / "native")
    iiwa = Bench(tmp_path / "native", "pfc_panda_7r", PANDA, "iiwa")
    step, loop = (iiwa.folder / f"{n}.o" for n in ("controller_functions_step", "messages"))
    before = step.stat().st_mtime_ns, loop.stat().st_mtime_ns
    told = iiwa.statuses(0.4)
    run, repeated = iiwa.answer(iiwa.rows(told[:200] + told[203:]))
    assert step.stat().st_mtime_ns == before[0]
    assert loop.stat().st_mtime_ns > before[1]
    assert repeated.first is None
    assert repeated.result.fault is None
    assert np.ptp(run.rows["sent"], axis=0).max() > 1.0


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize(
    ("name", "changes", "kind"),
    [
        ("pfc_elastic_6r", FROM_TORQUE, "iiwa"),
        pytest.param("pfc_compliant_6r", [], "panda", marks=pytest.mark.slow),
        pytest.param(
            "pfc_scara_4r", ["controller.law=velocity_servo"], "panda", marks=pytest.mark.slow
        ),
    ],
)
def test_other_laws_and_what_they_are_told(tmp_path, name, changes, kind):
    """Torques, forces, velocities: what is lost is made up for alike."""
    bench = Bench(tmp_path / "native", name, changes, kind)
    told = bench.statuses(0.5)
    # what is told as before does not fit what the controller wants: laws for elastic joints notice
    kept = [x for k, x in enumerate(told) if k < 300 or k % 37 != 20]
    run, repeated = bench.answer(bench.rows(kept))
    assert repeated.first is None, repeated.warnings
    assert run.rows["missed"].any()
    assert not run.rows["fault"][:300].any()
    assert np.ptp(run.rows["sent"], axis=0).max() > 1e-3


class FakeLoop:
    """Something in place of the loop, in words of the shell."""

    def __init__(self, bench, words):
        self.bench, self.folder, self.record = bench, bench.folder, bench.project.record
        self.program = bench.folder / "fake"
        self.program.write_text(f"#!/bin/sh\n{words}\n")
        self.program.chmod(0o755)

    def run(self, interrupted=lambda: False, progress=quiet, keys=lambda share: []):
        operator = Operator(RequestEndpoint(DrakeLcm("memq://")), keys, 0.8, 1.2)
        return run_native(self, ADDRESS, 5.0, interrupted, progress, operator)


def test_what_the_loop_says(panda, told):
    panda.project.record.write(panda.folder / "kept", panda.rows(told[:3]))
    seen = []
    words = (
        'echo "$*" > arguments; cp kept drive.bin; echo t 1.5; echo priority none; echo end mode'
    )
    loop = FakeLoop(panda, f'cd "$(dirname "$0")"; {words}')
    run = loop.run(progress=lambda time, what: seen.append((time, what)))
    assert (run.reason, run.messages, len(run.rows)) == ("mode", ["priority none"], 3)
    assert seen == [(1.5, "driving at 80%")]
    said = (panda.folder / "arguments").read_text().split()
    assert said == ["239.255.76.67", "7667", "0", "5.0", str(panda.folder / "drive.bin"), "0.8"]


def test_a_loop_that_breaks_off(panda, told):
    panda.project.record.write(panda.folder / "kept", panda.rows(told[:3]))
    run = FakeLoop(panda, 'cd "$(dirname "$0")"; cp kept drive.bin; kill -SEGV $$').run()
    assert run.reason is None
    assert run.messages == ["the loop in C ended abnormally with status -11"]
    repeated = RepeatedDrive(run, panda.make_drive, panda.dialect, quiet)
    assert repeated.result.fault == run.messages[0]
    with pytest.raises(
        InputError, match="--native: 7: no such network; the loop in C ended abnormally"
    ):
        FakeLoop(panda, "echo 7: no such network; exit 2").run()


def test_an_interruption_is_passed_on(panda, told):
    panda.project.record.write(panda.folder / "kept", panda.rows(told[:3]))
    begin = time.monotonic()
    words = """trap 'cp kept drive.bin; echo end rested; exit 0' TERM
        n=0; while [ $n -lt 100 ]; do sleep 0.1; n=$((n + 1)); done"""
    loop = FakeLoop(panda, f'cd "$(dirname "$0")"; {words}')
    run = loop.run(interrupted=lambda: time.monotonic() - begin > 0.5)
    assert run.reason == "rested"
    assert time.monotonic() - begin < 8.0


def test_what_people_ask_for_goes_to_the_loop_line_by_line(panda, told):
    panda.project.record.write(panda.folder / "kept", panda.rows(told[:3]))
    asked = [[Request(0.3)], [], [Request(1.5), Request(stop=True)]]
    words = "read a; read b; read c; echo $a $b $c > asked; cp kept drive.bin; echo end rested"
    loop = FakeLoop(panda, f'cd "$(dirname "$0")"; {words}')
    run = loop.run(keys=lambda share: asked.pop(0) if asked else [])
    assert run.reason == "rested"
    # no faster than drives can do
    assert (panda.folder / "asked").read_text().split() == ["o", "0.3", "o", "1.2", "s"]


def test_messages_ask_as_keys_do_and_are_told_how_far_it_is():
    lcm = DrakeLcm("memq://")
    operator = Operator(RequestEndpoint(lcm), lambda share: [], 1.0, 1.5)
    watching = ObserverEndpoint(lcm, dialect("panda"))
    watching.send_request(Request(0.5))
    assert operator.lines() == "o 0.5\n"
    assert operator.lines() == ""
    watching.send_request(Request(stop=True))
    assert operator.lines() == "s\n"
    operator.tell(1.25)
    watching.receive(0.0)
    told = watching.progress
    assert (told["time"], told["override"], told["stopping"]) == (1.25, 0.5, 1.0)


def test_who_is_impatient_ends_the_loop_too(panda):
    def impatient():
        raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        FakeLoop(panda, "exec sleep 60").run(interrupted=impatient)
    assert time.monotonic() - began < 20.0


def test_nobody_was_there(panda):
    nothing = NativeRun(panda.rows([]), "silence")
    with pytest.raises(InputError, match="no status of the robot for 100 ms"):
        RepeatedDrive(nothing, panda.make_drive, panda.dialect, quiet)


def test_a_robot_that_has_moved_meanwhile_is_refused_in_the_same_words(panda, told):
    moved = changed(told[:1], 0, lambda s: {"v": s.v + 0.1})
    run = NativeRun(panda.rows(moved), "refused")
    with pytest.raises(InputError, match=r"the robot moves: joint 1 at 0\.1 rad/s"):
        RepeatedDrive(run, panda.make_drive, panda.dialect, quiet)
