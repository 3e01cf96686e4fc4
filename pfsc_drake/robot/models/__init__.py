"""Model files and parameters of robots."""
