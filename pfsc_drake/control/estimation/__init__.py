"""Estimation from sampled signals."""
