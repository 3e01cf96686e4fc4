"""Manifolds as maps on jets: a path, and a point that moves with time."""
