"""Regions that a tool may not enter: signed global distances to their boundaries."""
