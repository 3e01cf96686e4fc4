"""Options of a controller; blocks of a scenario file."""
