"""Measurements of a robot: records, their files and checks, periods, a simulated robot."""
