"""Whole controllers, from the joint state to the drives."""
