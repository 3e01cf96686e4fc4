"""Motions that make the parameters of a robot visible in its drives' torques."""
