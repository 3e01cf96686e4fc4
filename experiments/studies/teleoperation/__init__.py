"""Teleoperation over a channel: what passes for transparent and stable, and what is passive."""
