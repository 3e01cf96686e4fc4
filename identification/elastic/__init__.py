"""Stiffness, damping and motor inertia of elastic joints."""
