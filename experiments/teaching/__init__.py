"""Teaching of paths by hand guiding, and following of taught paths."""
