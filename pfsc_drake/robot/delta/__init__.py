"""The DELTA robot."""
