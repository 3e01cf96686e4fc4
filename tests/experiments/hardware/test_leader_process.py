"""A leader in a process of its own; with its follower in another one, as a user starts them."""

import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from experiments.cli import main
from experiments.hardware.leader_process import lead_scenario
from experiments.scenario_file import read_scenario
from pfsc_drake.errors import InputError
from tests.experiments.hardware.test_two_processes import ROOT, is_allowed

# a leader that moves before its follower is there has done so when it comes
_ALONE = """
ip link set lo up; ip route add 224.0.0.0/4 dev lo
{python} -m experiments run teleop_region --out {out}/follower --duration 8 --no-recording \\
    --set teleoperation.lcm=udpm:// > {out}/follower.txt 2>&1 &
FOLLOWS=$!
until grep -q "simulating " {out}/follower.txt || ! kill -0 $FOLLOWS; do sleep 0.1; done
{python} -m experiments lead teleop_region --lcm udpm:// --duration 120 > {out}/lead.txt 2>&1 &
LEADS=$!
wait $FOLLOWS; STATUS=$?; kill $LEADS; wait $LEADS; exit $STATUS
"""


@pytest.mark.slow
def test_a_leader_without_a_follower_is_held_by_damping_alone():
    told = []
    scenario = read_scenario("teleop_region", ["hand.tremor=0"])
    led = lead_scenario(scenario, DrakeLcm("memq://"), duration=0.8, notify=told.append)
    assert led.received == 0
    assert led.least_tank > 0.0
    assert led.travel < 0.1
    assert told == ["leader ready; waiting for a follower"]


def test_only_what_is_led_from_afar_is_led():
    with pytest.raises(InputError, match="teleoperation = null"):
        lead_scenario(
            read_scenario("vf_forbidden_region", []),
            DrakeLcm("memq://"),
            duration=1.0,
            notify=print,
        )


def test_a_wrong_bus_is_refused(capsys):
    assert main(["lead", "teleop_region", "--lcm", "upm://"]) == 2
    assert "no such bus" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not is_allowed(), reason="no network namespaces here")
def test_two_processes_lead_and_follow(tmp_path):
    words = _ALONE.format(python=sys.executable, out=tmp_path)
    ended = subprocess.run(
        ["unshare", "-n", "bash", "-c", words],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        timeout=170,
    )
    said = (tmp_path / "follower.txt").read_text() + (tmp_path / "lead.txt").read_text()
    assert ended.returncode in (0, 3), said
    assert "follower connected" in said
    metrics = json.loads((tmp_path / "follower" / "metrics.json").read_text())
    assert metrics["least_port_tank"]["value"] >= 0.0
    assert metrics["audit_ports"]["value"] < 1e-12
    assert metrics["deepest_violation"]["value"] < 3e-4
    with h5py.File(tmp_path / "follower" / "log.h5") as log:
        way = np.linalg.norm(log["y_t"][:] - log["y_t"][0], axis=1)
    assert way.max() > 0.02
