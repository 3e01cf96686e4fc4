"""Obstacles that move: progress along a path waits for them, and elbows give way."""
