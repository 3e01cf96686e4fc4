"""Simulated physics: friction, drives, sensors, operators, forces."""
