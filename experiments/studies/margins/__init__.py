"""Margins of a scenario's closed loop, as it is sampled, before the robot moves."""
