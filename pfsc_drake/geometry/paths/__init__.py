"""Paths: arc length, moving frame, projection, and what a law reads of them at each tick."""
