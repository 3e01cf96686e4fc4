"""Teleoperation: passive couplings of two sides over a channel."""
