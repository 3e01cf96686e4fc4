"""The law: actuation, linearization, decoupling, stabilization, reference."""
