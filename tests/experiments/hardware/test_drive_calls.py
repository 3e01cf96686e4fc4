"""Robots that are driven from scripts: what is refused; :mod:`test_two_processes` drives one."""

import pytest

from experiments import check_robot, drive, first_command
from pfsc_drake import InputError

SCENARIO, NOBODY = "pfc_panda_7r", {"lcm": "memq://", "quiet": True}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"duration": 0.0}, "duration = 0.0; allowed: a positive number of seconds"),
        ({"duration": float("nan")}, "duration = nan; allowed: a positive number of seconds"),
        ({"override": 3.0}, "--override = 3.0; allowed: 0.01 to"),
        ({"driver": "ur5"}, "driver ur5: allowed: panda, iiwa"),
        ({"lcm": "nothing://"}, "--lcm nothing://: no such bus"),
    ],
)
def test_what_is_refused(given, said, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(InputError) as raised:
        drive(SCENARIO, out=out, **(NOBODY | given))
    assert said in str(raised.value)
    assert not out.exists()


@pytest.mark.slow
def test_nobody_answers(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.hardware.driven_run._FIRST_STATUS", 0.1)
    for call, where in ((drive, {"out": tmp_path / "out"}), (first_command, {})):
        with pytest.raises(InputError, match="no status of a robot on PANDA_STATUS within"):
            call(SCENARIO, **NOBODY, **where)
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="PANDA_STATUS"):
        check_robot(SCENARIO, **NOBODY)
