"""From a robot to its model: excitation, measurement, estimation (Sec. 2.4.6, 2.5)."""

import os

# threads of BLAS compete with the processes side by side, and take longer than one does alone
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
