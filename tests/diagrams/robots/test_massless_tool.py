"""Frames without mass at the end of an arm, as most URDFs have them (``flange``, ``tool0``)."""

import re
from pathlib import Path

import pytest
from pydrake.systems.framework import DiagramBuilder

from diagrams.robots.arm import add_arm
from diagrams.station_options import StationOptions
from experiments.studies.margins.analysis import _feasible_errors
from experiments.studies.margins.box import ErrorBox
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model


@pytest.fixture(scope="module", name="massless")
def fixture_massless(tmp_path_factory):
    """A model whose tool has no mass, and hangs on a flange that has none either."""
    text = resolve_model("comau_racer_1_4").read_text(encoding="utf-8")
    begin = text.index('<link name="tool">')
    end = text.index("</inertial>", begin)
    inertial = re.sub(r"(<mass>|<i..>)[^<]*<", r"\g<1>0<", text[begin:end])
    text = (
        text[:begin]
        + re.sub(r"<inertial>\s*<pose>[^<]*</pose>", "<inertial>", inertial)
        + (text[end:])
    )
    nothing = "<inertial><mass>0</mass><inertia>"
    nothing += "".join(f"<{i}>0</{i}>" for i in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    flange = f"<link name='flange'>{nothing}</inertia></inertial></link>"
    flange += "<joint name='link_6-flange' type='fixed'><parent>link_6</parent>"
    flange += "<child>flange</child></joint>"
    joint = text.index('<joint name="weld_tool"')
    text = text[:joint] + flange + text[joint:].replace(">link_6<", ">flange<", 1)
    file = tmp_path_factory.mktemp("massless") / "arm.sdf"
    file.write_text(text.replace("weld_tool", "flange-tool0"), encoding="utf-8")
    return file


@pytest.fixture(name="settings")
def fixture_settings(load_scenario, massless):
    settings = load_scenario("pfc_compliant_6r")
    settings.robot.model = str(massless)
    settings.model_error = type(settings.model_error)()
    return settings


def test_the_sensor_sits_at_the_flange_by_default(load_scenario, settings):
    arm = add_arm(DiagramBuilder(), StationOptions(settings, Path()).nominal_model_source).actual
    assert arm.sensor_joint("").name() == "link_6-flange"
    assert arm.sensor_joint("flange-tool0").name() == "flange-tool0"
    assert arm.tool_load("").mass == 0.0
    for name in ("comau_racer_1_4", "comau_racer_1_4_elastic", "franka_emika_panda", "scara_600"):
        settings.robot.model = name
        assert add_arm(
            DiagramBuilder(), StationOptions(settings, Path()).nominal_model_source
        ).actual.sensor_joint("").name() == ("weld_tool")
    settings.robot.tool_frame = "link_4"
    settings.robot.model = "scara_600"
    arm = add_arm(DiagramBuilder(), StationOptions(settings, Path()).nominal_model_source).actual
    with pytest.raises(InputError, match=r"sensor.joint: the tool frame 'link_4' belongs to the"):
        arm.sensor_joint("")


def test_a_box_of_errors_omits_impossible_models(settings):
    """Before the linearization: the mass of a tool without mass cannot be reduced."""
    part = add_arm(DiagramBuilder(), StationOptions(settings, Path()).nominal_model_source)
    remarks = []
    singles, together = _feasible_errors(ErrorBox(), settings, part, Path(), remarks)
    assert [str(error) for _, error in singles] == [
        "nominal masses 5 % too low",
        "nominal masses 5 % too high",
        "nominal tool 0.1 kg too heavy",
    ]
    assert [str(error) for error in together] == [
        "nominal masses -5 %, tool +0.1 kg",
        "nominal masses +5 %, tool +0.1 kg",
    ]
    (remark,) = remarks
    assert "nominal tool 0.1 kg too light: omitted" in remark and "has no mass" in remark
    settings.model_error.tool_mass = -0.1
    with pytest.raises(InputError, match=r"model_error.tool_mass = -0.1 kg; allowed: 0 kg or more"):
        part.check_nominal_model(StationOptions(settings, Path()).nominal_model_source, "")
    settings.robot.model = "comau_racer_1_4"
    whole = add_arm(DiagramBuilder(), StationOptions(settings, Path()).nominal_model_source)
    assert len(_feasible_errors(ErrorBox(), settings, whole, Path(), remarks)[1]) == 4
