"""Path and surface following control as Drake systems.

After B. Bischof, "Path and Surface Following Control for Industrial Robotic
Applications", dissertation, TU Wien, 2018.

Layers, imports only point downwards:

* :mod:`pfsc_drake.systems`: Drake LeafSystems.
* :mod:`pfsc_drake.control`: control laws as pure functions.
* :mod:`pfsc_drake.robot`: kinematics and dynamics of serial chains.
* :mod:`pfsc_drake.geometry`: curves, projection, moving frames.
* :mod:`pfsc_drake.jets`: truncated Taylor arithmetic.
"""

from pfsc_drake.errors import InputError

__version__ = "0.1.0"

__all__ = ["InputError", "__version__"]
