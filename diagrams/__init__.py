"""Builders that wire the systems into stations: plant, controller, visualization."""
