"""What is prepared for a robot that stands elsewhere."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from experiments.hardware.driven_run import DriveOptions, drive_scenario, prepare_driven
from experiments.scenario_file import read_scenario
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import dialect
from pfsc_drake.errors import InputError


def nothing(_time, _phase):
    """Say nothing of the progress."""


def prepared(name="pfc_panda_7r", *overrides):
    scenario = read_scenario(name, list(overrides))
    return prepare_driven(scenario, None, recording=False, progress=nothing)


def test_what_is_said_of_it():
    run = prepared()
    assert run.settings.start.transition == 0.5
    assert run.settings.faults.effort_share == 0.35


@pytest.mark.parametrize("override", [0.0, 1.6, np.nan])
def test_overrides_out_of_range(override, tmp_path):
    end = ControllerEndpoint(DrakeLcm("memq://"), dialect("panda"))
    scenario = read_scenario("pfc_panda_7r", [])
    with pytest.raises(InputError, match="--override = "):
        drive_scenario(
            scenario,
            end,
            tmp_path / "out",
            DriveOptions(override=override, figures=False, recording=False),
            nothing,
        )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("plate_mounting", "plate = given"),
        ("pfc_delta", "robot.model = .* an arm, where it is in another process"),
        ("pfc_elastic_6r", "controller.state = measured; allowed: from_torque"),
    ],
)
def test_what_is_not_driven(name, said):
    with pytest.raises(InputError, match=said):
        prepared(name)


def test_nobody_answers(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.hardware.driven_run._FIRST_STATUS", 0.1)
    end = ControllerEndpoint(DrakeLcm("memq://"), dialect("panda"))
    with pytest.raises(InputError, match="no status of a robot on PANDA_STATUS within"):
        drive_scenario(
            read_scenario("pfc_panda_7r", []),
            end,
            tmp_path / "out",
            DriveOptions(figures=False, recording=False),
            nothing,
        )
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_controller_in_c_is_not_led_from_afar(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.hardware.driven_run.check_native", lambda *_: None)
    with pytest.raises(InputError, match="--native: not possible with a leader device"):
        drive_scenario(
            read_scenario("teleop_path", ["teleoperation.lcm=memq://"]),
            ControllerEndpoint(DrakeLcm("memq://"), dialect("panda")),
            tmp_path / "out",
            DriveOptions(native=True, figures=False, recording=False),
            nothing,
        )
