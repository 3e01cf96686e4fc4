"""Every task of a posture with every law, on the seven-axis arm."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import GainParameters, LawGains, PostureParameters
from pfsc_drake.control.law.laws import RELATIVE_DEGREE

ELASTIC = "franka_emika_panda_elastic"
# the elbow is at the side
START = [-90, 60, 90, -110, -40, 110, 20]
TASKS = {
    "reference": {"reference_deg": [-80, 60, 80, -100, -40, 110, 20]},
    "limits": {"weight": "range"},
    "conditioning": {"weight": "inertia"},
    "elbow": {},
}
LAWS = {
    "velocity_servo": ("franka_emika_panda", 2e-4, [-25.0]),
    "rigid": ("franka_emika_panda", 2e-4, [-30.0] * 2),
    "singular_perturbation": (ELASTIC, 2e-3, [-20.0] * 2),
    "visco_elastic": (ELASTIC, 2e-4, [-30.0] * 3),
    "elastic": (ELASTIC, 2e-4, [-40.0, -40.0, -220.0, -300.0]),
}
# each task and each law once; all of them take long
QUICK = {
    ("reference", "rigid"),
    ("limits", "velocity_servo"),
    ("limits", "visco_elastic"),
    ("conditioning", "singular_perturbation"),
    ("elbow", "elastic"),
}
COMBINATIONS = [
    pytest.param(
        task, law, marks=() if (task, law) in QUICK else pytest.mark.slow, id=f"{task}-{law}"
    )
    for task in TASKS
    for law in LAWS
]


@pytest.mark.slow
@pytest.mark.parametrize(("task", "law"), COMBINATIONS)
def test_a_posture_moves_and_the_tool_does_not_notice(load_exact_scenario, law, task):
    settings = load_exact_scenario("pfc_elbow_7r")
    model, bound, poles = LAWS[law]
    settings.robot.model, settings.controller.law = model, law
    if law == "visco_elastic":
        settings.robot.joint_damping = [20.0] * 7
    settings.controller.gains = {
        law: LawGains(*[GainParameters(poles=list(poles)) for _ in range(4)])
    }
    settings.controller.boundary_layer_damping = [0.005] * 7
    settings.controller.posture = PostureParameters(task=task, **TASKS[task])
    settings.controller.external_torque.source = "none"
    settings.start.posture_deg, settings.start.offset = START, [0.0, 0.0]
    settings.start.rotation_deg, settings.pushes = [0.0, 0.0, 0.0], []
    settings.reference.dwell = 0.05
    settings.simulation.integrator = "runge_kutta3"
    station = build_station(settings, Path())
    assert station.law.linearization.relative_degree == RELATIVE_DEGREE[law]
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(0.3)
    assert station.fault(root) is None
    log = station.log.read(root)[1]
    n = station.robot.dimension
    Y = log["law"][:, station.law.layout.manifold_state][:, 1:6]
    assert np.abs(Y).max() < bound
    q, q_0 = log["joint_state"][:, :n], log["posture_reference"][:, :n]
    assert np.abs(q[-1] - q[0]).max() > 1e-3
    assert (np.abs(q_0[-1] - q_0[0]).max() > 1e-3) == (task != "elbow")
