"""The log of a tool that was led, made without a robot."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.results.run_log import RunLog
from experiments.scenario_file import read_scenario
from pfsc_drake.yaml.reading import dump_yaml


class GuidedTool:
    """A tool that is led along a curve, which the controller sees a constant shift away."""

    SHIFT = np.array([2e-3, -1e-3, 0.0])

    def __init__(self, positions, turns):
        """Take positions [m], shape (n, 3), and rotation vectors [rad], shape (n, 3)."""
        self.positions, self.R = positions, Rotation.from_rotvec(turns).as_matrix()
        self.settings = read_scenario("teach_by_hand_6r", [])

    def log(self, **attributes):
        log = RunLog(1e-3 * np.arange(len(self.positions)), attributes=attributes)
        log.add("y_t", self.positions, "m")
        log.add("R_e", self.R.reshape(-1, 9), "1")
        log.add("y_t_measured", self.positions + self.SHIFT, "m")
        log.add("R_e_measured", self.R.reshape(-1, 9), "1")
        log.add(
            "q_J_measured", np.tile(np.deg2rad([-21, 89, -27, 12, 103, 4]), (len(self.R), 1)), "rad"
        )
        return log

    def write(self, folder, *changes):
        """Write what a run leaves, with overrides of its scenario."""
        folder.mkdir()
        scenario = read_scenario("teach_by_hand_6r", list(changes))
        (folder / "scenario.yaml").write_text(dump_yaml(scenario.data), encoding="utf-8")
        self.log().write(folder / "log.h5")
        return folder


@pytest.fixture(name="wave")
def fixture_wave():
    """0.3 m in 3 s with a wave in it, after a rest and before another, and a quarter turn."""
    x = np.concatenate([np.zeros(500), np.linspace(0.0, 1.0, 3000), np.ones(500)])
    y = np.stack([0.8 + 0.0 * x, 0.3 * x, 1.0 + 0.02 * np.sin(2 * np.pi * x)], axis=1)
    tremor = 1e-4 * np.random.default_rng(0).normal(size=y.shape)
    return GuidedTool(y + tremor, np.stack([np.pi + 0 * x, 0 * x, 0.5 * x], axis=1))


@pytest.fixture(name="still")
def fixture_still():
    return GuidedTool(np.tile([0.8, 0.0, 1.0], (500, 1)), np.tile([np.pi, 0.0, 0.0], (500, 1)))


@pytest.fixture(name="lap")
def fixture_lap():
    """Once round a circle of 0.1 m, all but 5 mm."""
    angle = np.linspace(0.0, 2.0 * np.pi - 0.05, 3000)
    y = np.stack([0.8 + 0.1 * np.cos(angle), 0.1 * np.sin(angle), 1.0 + 0.0 * angle], axis=1)
    return GuidedTool(y, np.tile([np.pi, 0.0, 0.0], (3000, 1)))
