"""Schema of a scenario file, and its reduction for a robot in another process."""

import math

import pytest

from diagrams.scenario.schema import Scenario
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed

INFINITE = math.inf


def load(**data):
    return load_typed(Scenario, data, "mine.yaml")


def test_everything_has_a_default():
    settings = load()
    assert settings.duration == 0.0
    assert settings.controller.sampling_time == 1e-3
    assert settings.simulation.max_step <= settings.controller.sampling_time


@pytest.mark.parametrize(
    ("data", "key"),
    [
        ({"start": {"offset": [0.1]}}, "offset"),
        ({"start": {"rotation_deg": [1.0, 2.0]}}, "rotation_deg"),
        ({"path": {"orientation": {"keyframes": [{"angles_deg": [1.0]}]}}}, "angles_deg"),
        ({"path": {"orientation": {"convention": "xyz"}}}, "convention"),
        ({"path": {"shape": {"_tag": "!Line", "start": [1.0, 2.0]}}}, "start"),
        ({"path": {"shape": {"_tag": "!Line", "end": [1.0, 2.0, 3.0, 4.0]}}}, "end"),
        ({"path": {"shape": {"_tag": "!Circle", "center": [1.0, 2.0]}}}, "center"),
        ({"path": {"shape": {"_tag": "!Circle", "axis_u": [1.0, 0.0]}}}, "axis_u"),
        ({"path": {"shape": {"_tag": "!Circle", "axis_v": [1.0, 0.0]}}}, "axis_v"),
        ({"path": {"shape": {"_tag": "!Waypoints", "smoothness": 7}}}, "smoothness"),
        ({"path": {"shape": {"_tag": "!Waypoints", "parametrization": "x"}}}, "parametrization"),
        ({"path": {"shape": {"_tag": "!Waypoints", "corner_distance": 1e-5}}}, "corner_distance"),
        ({"controller": {"law": "magic"}}, "law"),
        ({"controller": {"gains": {"magic": {}}}}, "gains"),
        (
            {"controller": {"gains": {"rigid": {"eta": {"poles": [-1.0], "integral": 1.0}}}}},
            "poles",
        ),
        ({"controller": {"sampling_time": 0.0}}, "sampling_time"),
        ({"controller": {"sampling_time": INFINITE}}, "sampling_time"),
        ({"controller": {"effort_scale": -1.0}}, "effort_scale"),
        ({"controller": {"brake_damping": -1.0}}, "brake_damping"),
        ({"controller": {"brake_damping": INFINITE}}, "brake_damping"),
        ({"reference": {"points": []}}, "points"),
        ({"reference": {"points": [0.1]}}, "points"),
        ({"reference": {"points": [0.0, 1e16]}}, "points"),
        ({"reference": {"velocity": 1e-300}}, "velocity"),
        ({"reference": {"acceleration": 1e300}}, "acceleration"),
        ({"reference": {"dwell": 1e300}}, "dwell"),
        ({"reference": {"dwell": 1e-300}}, "dwell"),
        ({"start": {"rotation_deg": [1e300, 0.0, 0.0]}}, "rotation_deg"),
        ({"start": {"posture_deg": [1e300]}}, "posture_deg"),
        ({"robot": {"base_pose": {"zyx_deg": [1e300, 0.0, 0.0]}}}, "zyx_deg"),
        ({"servo": {"period": 1e-300}}, "period"),
        ({"friction": {"f_v": [1e300]}}, "f_v"),
        ({"notch": {"displacement": [0.0, 1.7e308, 0.0]}}, "displacement"),
        ({"notch": {"depth": INFINITE}}, "depth"),
        ({"notch": {"ball": {"distance": 1e300}}}, "distance"),
        ({"notch": {"ball": {"resolution": 1e-9}}}, "resolution"),
        ({"notch": {"ball": {"modulus": 1e300}}}, "modulus"),
        ({"simulation": {"integrator": "magic"}}, "integrator"),
        ({"simulation": {"max_step": 0.0}}, "max_step"),
        ({"simulation": {"max_step": -1.0}}, "max_step"),
        ({"simulation": {"accuracy": -1e-6}}, "accuracy"),
        ({"simulation": {"accuracy": INFINITE}}, "accuracy"),
        ({"simulation": {"accuracy": 1e-300}}, "accuracy"),
        ({"simulation": {"frame_period": 1e-9}}, "frame_period"),
        # stale caches after a rejected step: silently a hundred times less accurate
        ({"simulation": {"integrator": "runge_kutta5", "accuracy": 1e-6}}, "accuracy"),
        ({"simulation": {"frame_period": 0.0}}, "frame_period"),
        ({"simulation": {"frame_period": -1.0}}, "frame_period"),
        ({"duration": -1.0}, "duration"),
        ({"duration": INFINITE}, "duration"),
        ({"settling_tolerance": -1.0}, "settling_tolerance"),
        ({"targets": {"magic": {}}}, "targets"),
    ],
)
def test_refused_with_file_and_key(data, key):
    with pytest.raises(InputError) as caught:
        load(**data)
    message = str(caught.value)
    assert message.startswith("mine.yaml: ")
    assert key in message
    assert "allowed: " in message


def test_error_control_where_it_works():
    settings = load(simulation={"integrator": "runge_kutta3", "accuracy": 1e-6})
    assert settings.simulation.accuracy == 1e-6
