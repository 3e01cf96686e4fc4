"""Environment of a robot: operators, forces, workpieces, obstacles."""
