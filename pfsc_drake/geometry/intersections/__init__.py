"""Edges, where two surfaces meet, and corners, where three do."""
