"""Stability margins of a scenario's sampled closed loop, before the robot moves."""
