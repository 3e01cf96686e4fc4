"""Loops as functions of what is believed, against stations that were built for each belief."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario import Scenario
from experiments.scenario_file import read_scenario
from experiments.studies.margins.box import Error, smooth, without_error
from experiments.studies.margins.loop import StationLoop
from experiments.studies.margins.walk import walk
from pfsc_drake.yaml.typed import load_typed

WRONG = Error((("mass", -0.05), ("stiffness", 0.05), ("rotor_inertia", 0.1), ("tool_mass", 0.1)))
# each law that can be a function of its belief, observers, a surface, an elbow, a sliding joint
LOOPS = {
    "pfc_elastic_3r": [],
    "pfc_viscoelastic_3r": [],
    "ttc_comau_6r": [],
    "friction_observer_in_loop": [],
    "sfc_elastic_6r": ["model_error.mass=0.9"],
    "pfc_elbow_7r": [],
    "pfc_scara_4r": [],
}


AUTO = "{poles: auto, bandwidth: 20}"


def started(name, *overrides):
    file = read_scenario(name, list(overrides))
    settings, _ = smooth(load_typed(Scenario, file.data, name))
    folder = Path(file.path).parent
    return settings, folder, StationLoop(without_error(settings), folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_a_parametric_loop_is_the_one_built_for_a_belief(name):
    settings, folder, walked = started(name, *LOOPS[name])
    assert walked.parametrize(settings, folder)
    section = walk(walked, 0.05, lambda _: None, only_start=True).instants[0].section
    rest = walked.derivative.at(section).rest
    wrong = WRONG.applied_to(settings)
    own, other = (
        walked.with_nominal_model(belief, folder).parameters for belief in (settings, wrong)
    )
    found = walked.derivative.at(section, None, rest, other).A
    built = StationLoop(wrong, folder, walked)
    expected = built.derivative.at(built.map.adopted(section), None, rest).A
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * scale)
    # an error changes something
    before = walked.derivative.at(section, None, rest, own).A
    assert np.abs(found - before).max() > 1e-3 * scale


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("pfc_compliant_6r", ["controller.law=rigid"]),  # compensates what hangs at its sensor
        ("plate_mounting_tracking", []),  # servos
        ("pfc_delta", []),
        ("pfc_elastic_3r", [f"controller.gains.elastic={{eta: {AUTO}, xi: {AUTO}}}"]),
    ],
)
def test_what_calculates_with_a_belief_beforehand_is_built_for_each(name, overrides):
    settings, folder, walked = started(name, *overrides)
    assert not walked.parametrize(settings, folder)
