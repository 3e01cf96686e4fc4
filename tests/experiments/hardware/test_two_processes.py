"""A robot and its controller as a user starts them: two processes on a bus of this machine."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from tests.compilers import needs_gcc

ROOT = Path(__file__).resolve().parents[3]
# a network of its own, whose only device is the loopback, so that nothing leaves this machine
_ALONE = """
ip link set lo up; ip route add 224.0.0.0/4 dev lo
env --default-signal=INT {first} {python} -m experiments robot {robot} --no-meshcat --duration 160 \
    > {out}/robot.txt 2>&1 &
for _ in $(seq 200); do grep -q joints {out}/robot.txt && break; sleep 0.2; done
{python} {program} > {out}/drive.txt 2>&1
STATUS=$?; kill -INT $!; wait $!; exit $STATUS
"""


def is_allowed():
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return False
    tried = ["unshare", "-n", "sh", "-c", "ip link set lo up && ip route add 224.0.0.0/4 dev lo"]
    return subprocess.run(tried, capture_output=True).returncode == 0


def before_others():
    """Return what lets a robot and all its threads go before others, where that is allowed."""
    words = ["chrt", "-f", "50"]
    if shutil.which("chrt") is None or subprocess.run([*words, "true"]).returncode != 0:
        return ""
    return " ".join(words)


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not is_allowed(), reason="no network namespaces here"),
]


def both(tmp_path, robot, drive, first=""):
    """Return the exit status of what drives, and what both have said."""
    return beside(tmp_path, robot, f"-m experiments drive {drive} --no-figures", first)


def beside(tmp_path, robot, program, first=""):
    """Return the exit status of a program of Python beside a robot, and what both have said."""
    given = {"robot": robot, "program": program, "first": first}
    words = _ALONE.format(python=sys.executable, out=tmp_path, **given)
    # what is compiled here is to be there soon
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MAKEFLAGS": "OPTIMIZATION=-O0"}
    ended = subprocess.run(
        ["unshare", "-n", "bash", "-c", words], cwd=ROOT, env=environment, timeout=170
    )
    return ended.returncode, *((tmp_path / f"{x}.txt").read_text() for x in ("robot", "drive"))


def is_near(status, metrics):
    """Return whether the tool was near its path, if it came there.

    A machine that is busy with other things may stop a drive before.
    """
    deviation = metrics["rms_path_deviation"]["value"]
    return status == 3 if deviation is None else deviation < 1e-3


def test_a_panda_is_driven(tmp_path):
    out = tmp_path / "out"
    scenario = f"pfc_panda_7r --set start.transition=0.5 --out {out}"
    status, robot, drive = both(tmp_path, "pfc_panda_7r --low-pass 0", f"{scenario} --duration 3")
    assert "7 joints at" in robot
    assert status in (0, 3), drive
    metrics = json.loads((out / "metrics.json").read_text())
    assert is_near(status, metrics)
    assert (out / "recording.html").stat().st_size > 100_000
    with h5py.File(out / "log.h5") as log:
        assert log["sent"].shape[1] == 7
        assert "panda" in log.attrs["driven"]


def test_a_panda_is_driven_by_a_script(tmp_path):
    script, out = tmp_path / "script.py", tmp_path / "out"
    script.write_text(f"""
from experiments import check_robot, drive, first_command

first = first_command("pfc_panda_7r", quiet=True)
print(first.kind, abs(first.values).max() < 1.0)
print(check_robot("pfc_panda_7r", quiet=True).verdict)
changes = {{"start.transition": 0.5}}
driven = drive("pfc_panda_7r", changes, duration=1.0, out={str(out)!r}, figures=False, quiet=True)
print(driven.log["sent"].values.shape[1], driven.fault)
""")
    status, _, said = beside(tmp_path, "pfc_panda_7r --low-pass 0", str(script))
    assert status == 0, said
    assert said.startswith("TORQUE True\nthe robot's torques at rest agree with the model\n7 ")
    assert (out / "recording.html").is_file()


@needs_gcc
@pytest.mark.parametrize(("kind", "lost"), [("panda", 0.0), ("iiwa", 0.02)])
def test_a_robot_is_driven_in_c(tmp_path, kind, lost):
    out = tmp_path / "out"
    robot = f"pfc_panda_7r --low-pass 0 --driver {kind} --lose {lost}"
    scenario = f"pfc_panda_7r --driver {kind} --native --out {out} --duration 2"
    status, _, drive = both(tmp_path, robot, scenario, before_others())
    assert status in (0, 3), drive
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["largest_sent_difference"] == {"value": 0.0, "unit": "Nm"}
    assert is_near(status, metrics)
    assert 0.0 < metrics["link_answer_us"]["value"] < 200.0
    assert (out / "recording.html").stat().st_size > 100_000
    with h5py.File(out / "log.h5") as log:
        assert log["sent"].shape[1] == 7
        assert log.attrs["driven"] == f"over LCM, {kind}, by the controller in C"
        assert log["missed"][:].any() or not lost


def test_a_dry_run_sends_nothing(tmp_path):
    status, robot, drive = both(tmp_path, "pfc_panda_7r", "pfc_panda_7r --dry-run")
    assert status == 0, drive
    assert "nothing was sent" in drive
    assert ", 0 of them too old" in robot
    assert " 0 commands" in robot
