"""Recordings and block diagrams."""
