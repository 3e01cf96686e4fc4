"""Physically consistent parameters: nearest to an estimate, or from data, and as a model."""
