"""What the torques depend on: parameters, regressor, base parameters."""
