"""Shapes of paths, surfaces and regions."""
