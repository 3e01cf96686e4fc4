"""Controllers as C99 source, for whatever has no Python."""
