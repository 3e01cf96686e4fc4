"""Warnings before a run of a scenario, about its law, its sensors and its environment."""
