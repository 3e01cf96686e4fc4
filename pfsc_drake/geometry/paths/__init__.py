"""Paths: arc length, moving frame, projection, and the quantities of a law at each tick."""
