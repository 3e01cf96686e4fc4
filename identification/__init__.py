"""From a robot to its model: excitation, measurement, estimation (Sec. 2.4.6, 2.5).

From a script or a notebook::

    from identification import consistent_model, estimate

    found = estimate("my_arm.urdf", "record.csv", period=10.0, out="out/found")
    model = consistent_model(found, out="out/model", bounds="bounds.yaml")
"""

import os

from pfsc_drake.door import door

# threads of BLAS compete with the processes side by side, and take longer than one does alone
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# what users import, and the modules that are loaded when they do
_DOOR = {
    "Identification": "identification.api",
    "WrittenModel": "identification.consistency.writing",
    "consistent_model": "identification.api",
    "estimate": "identification.api",
    "simulate": "identification.api",
}

__all__ = [*_DOOR]

__getattr__ = door(__name__, _DOOR)
