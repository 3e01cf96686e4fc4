"""Surfaces in space: partial derivatives, curvature, checks and projections."""
