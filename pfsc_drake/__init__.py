"""Path and surface following control as Drake systems.

After B. Bischof, "Path and Surface Following Control for Industrial Robotic
Applications", dissertation, TU Wien, 2018.

The entry points are :func:`add_path_following`, :func:`add_path_streaming`,
:func:`add_surface_following` and :func:`add_guidance`; their arguments (paths, surfaces, regions,
options) have names here, too. Packages import downwards only:

* :mod:`pfsc_drake.controller`: whole controllers, from the joint state to the drives.
* :mod:`pfsc_drake.codegen`: controllers as C99.
* :mod:`pfsc_drake.systems`: blocks as Drake systems, single or fused; plants, drawing.
* :mod:`pfsc_drake.physics`: simulated effects outside the controller's model.
* :mod:`pfsc_drake.control`: laws, manifolds, observers, fixtures.
* :mod:`pfsc_drake.robot`: kinematics and dynamics.
* :mod:`pfsc_drake.geometry`: curves, surfaces, regions, projection, moving frames.
* :mod:`pfsc_drake.blocks`: blocks as expressions, and networks of them.
* :mod:`pfsc_drake.compiled`: expressions as machine code.
* :mod:`pfsc_drake.jets`: truncated Taylor arithmetic.
"""

from pfsc_drake.lazy_names import lazy_names

__version__ = "0.1.0"

__all__, __getattr__, __dir__ = lazy_names(__name__)
