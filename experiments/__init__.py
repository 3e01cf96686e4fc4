"""Experiments: scenario files, runs, logs, metrics, figures and reports.

From a script or a notebook::

    from experiments import load, run

    result = run("pfc_panda_7r", {"controller.law": "elastic"}, duration=2.0)
    result.log["xi"].values  # m
    again = load("out/pfc_panda_7r")
"""

import os

from pfsc_drake.door import door

# all matrices are small; BLAS threads would only compete with the control loop
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# what users import, and the modules that are loaded when they do
_DOOR = {
    "Commands": "experiments.replay",
    "ExportedController": "experiments.exported_controller",
    "FirstCommand": "experiments.hardware.driven_run",
    "Margins": "experiments.studies.margins.told",
    "Replay": "experiments.replay",
    "Run": "experiments.kept_run",
    "Scenario": "diagrams.scenario",
    "StaticCheck": "experiments.hardware.statics",
    "check_robot": "experiments.hardware.calls",
    "drive": "experiments.hardware.calls",
    "export_controller": "experiments.exported_controller",
    "first_command": "experiments.hardware.calls",
    "load": "experiments.kept_run",
    "margins": "experiments.api",
    "run": "experiments.api",
}

__all__ = [*_DOOR]

__getattr__ = door(__name__, _DOOR)
