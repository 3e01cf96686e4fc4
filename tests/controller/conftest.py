"""Robots as Drake alone knows them."""

from tests.diagrams.conftest import load_arm as load_arm
