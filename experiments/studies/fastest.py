"""The fastest motion on ten paths: against motions that are slowed down, and a finer grid."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from diagrams.builder import build_station, find_rest
from diagrams.scenario import Scenario
from diagrams.station import Station
from diagrams.station_parts import make_task
from diagrams.tasks.fastest_motion import FastestPlanner
from diagrams.tasks.task import DrivePlan
from experiments.scenario_file import ScenarioFile, read_scenario
from experiments.studies.study_page import write_study_page
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import RunRow
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import COLOURS, STYLE, WIDTH, Drawing, Figure, render

_LEMNISCATE = "pfc_elastic_6r"
# a line through random points of the reach of six axes, with the orientation kept
_ORIENTATION = "path.orientation={keyframes: [{angles_deg: [180, -15, 0]}]}"
_RANDOM = {"first": 3, "second": 5, "third": 8}
PATHS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "lemniscate, six elastic axes": (_LEMNISCATE, ("reference.points=[0.96, 0.31, 1.99]",)),
    "tilted circle, seven elastic axes": ("pfc_elastic_7r", ("reference.points=[0.0, 1.25]",)),
    "circle, seven rigid axes": ("pfc_panda_7r", ("reference.points=[0.0, 1.0]",)),
    "lemniscate, visco-elastic": ("pfc_viscoelastic_3r", ()),
    "DELTA": ("pfc_delta", ()),
    "SCARA": ("pfc_scara_4r", ()),
    "line on a surface": ("pfc_on_surface_6r", ()),
    **{f"random, {name}": (_LEMNISCATE, (f"random={seed}",)) for name, seed in _RANDOM.items()},
}
# on the path from the start, and nothing but the motion to be told of
_COMMON = (
    *("reference.speed=fastest", "reference.velocity=null", "reference.dwell=0.2"),
    *("start.offset=[0, 0]", "start.rotation_deg=[0, 0, 0]", "start.transition=0", "targets={}"),
)
_EXACT = (
    *("encoders={}", "friction={}", "model_error={}"),
    "simulation.integrator=auto",
)
_ERRORS = ("model_error={mass: 0.95, stiffness: 1.05}", "model_error={mass: 0.95}")
# what a motion that is slowed down was asked for [m/s, m/s^2]
_ASKED = ((0.5, 5.0), (1.0, 10.0), (2.0, 20.0), (4.0, 40.0))
_FINER = 4
_DESCRIPTION = ""
