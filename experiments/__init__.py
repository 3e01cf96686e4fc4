"""Experiments: scenario files, runs, logs, metrics, figures and reports.

From a script or a notebook::

    from experiments import load, run

    result = run("pfc_panda_7r", {"controller.law": "elastic"}, duration=2.0)
    result.log["xi"].values  # m
    again = load("out/pfc_panda_7r")
"""

import os

from pfsc_drake.lazy_names import lazy_names

# all matrices are small; BLAS threads would only compete with the control loop
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__all__, __getattr__, __dir__ = lazy_names(__name__)
