"""What is prepared for a robot that stands elsewhere."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from experiments.hardware import driven_run
from experiments.hardware.driven_run import drive_scenario, prepare_driven
from experiments.scenario_file import read_scenario
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import dialect
from pfsc_drake.errors import InputError


def nothing(_time, _phase):
    """Say nothing of the progress."""


def prepared(name="pfc_panda_7r", *overrides):
    scenario = read_scenario(name, list(overrides))
    return prepare_driven(scenario, None, recording=False, progress=nothing)


class Built(Exception):
    """The settings that a station was to be built of."""


def test_an_override_slows_both_directions_of_a_surface(monkeypatch):
    """By its square where it is an acceleration."""

    def build(settings, *_, **__):
        raise Built(settings.reference)

    monkeypatch.setattr(driven_run, "build_station", build)
    second = "{points: [0, 0.1], velocity: 0.2, acceleration: 3}"
    changes = "reference.places=[]", "reference.points=[0, 0.1]", f"reference.second={second}"
    found = []
    for override in (1.0, 0.5):
        with pytest.raises(Built) as built:
            prepared("sfc_polish", *changes, override=override)
        found.append(built.value.args[0])
    full, slow = found
    for one, other in ((full, slow), (full.second, slow.second)):
        assert other.velocity == 0.5 * one.velocity > 0.0
        assert other.acceleration == 0.25 * one.acceleration > 0.0


def test_what_is_said_of_it():
    run = prepared()
    assert run.settings.start.transition == 0.5
    assert run.settings.faults.effort_share == 0.35


@pytest.mark.parametrize("override", [0.0, 1.6, np.nan])
def test_overrides_out_of_range(override, tmp_path):
    end = ControllerEnd(DrakeLcm("memq://"), dialect("panda"))
    scenario = read_scenario("pfc_panda_7r", [])
    with pytest.raises(InputError, match="--override = "):
        drive_scenario(
            scenario,
            end,
            out=tmp_path / "out",
            duration=None,
            figures=False,
            recording=False,
            progress=nothing,
            override=override,
        )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("plate_mounting", "plate = given"),
        ("pfc_delta", "robot.model = .* an arm, where it stands elsewhere"),
        ("pfc_elastic_6r", "controller.state = measured; allowed: from_torque"),
    ],
)
def test_what_is_not_driven(name, said):
    with pytest.raises(InputError, match=said):
        prepared(name)


def test_nobody_answers(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.hardware.driven_run._FIRST_STATUS", 0.1)
    end = ControllerEnd(DrakeLcm("memq://"), dialect("panda"))
    with pytest.raises(InputError, match="no status of a robot on PANDA_STATUS within"):
        drive_scenario(
            read_scenario("pfc_panda_7r", []),
            end,
            out=tmp_path / "out",
            duration=None,
            figures=False,
            recording=False,
            progress=nothing,
        )
    assert not (tmp_path / "out").exists()
