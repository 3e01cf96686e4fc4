"""From a robot to its model: excitation, measurement, estimation (Sec. 2.4.6, 2.5).

From a script or a notebook::

    from identification import consistent_model, estimate

    found = estimate("my_arm.urdf", "record.csv", period=10.0, out="out/found")
    model = consistent_model(found, out="out/model", bounds="bounds.yaml")
"""

import os

from pfsc_drake.lazy_names import lazy_names

# BLAS threads compete with parallel processes, and then take longer than a single one
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__all__, __getattr__, __dir__ = lazy_names(__name__)
