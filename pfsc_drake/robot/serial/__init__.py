"""Serial chains: kinematics, Newton-Euler on jets, and the chain of a MultibodyPlant."""
