"""Paths whose waypoints arrive while the tool moves."""
