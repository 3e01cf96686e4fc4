"""Parameters, regressor and base parameters of a robot's torques."""
