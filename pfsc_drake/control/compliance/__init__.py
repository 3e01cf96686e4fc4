"""Compliance: tool load, forces along a manifold, impedance."""
