"""Experiments: scenario files, runs, logs, metrics, figures and reports."""

import os

# all matrices are small; BLAS threads would only compete with the control loop
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
