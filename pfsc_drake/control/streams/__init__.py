"""Paths whose way points come while the tool moves."""
