"""Controllers as C99 source."""
