"""Robots in diagrams: plant, drives, sensors."""
