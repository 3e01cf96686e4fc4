"""Motions that drives can follow: demand, slowing down, the fastest."""
