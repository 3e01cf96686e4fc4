"""Systems that draw in Meshcat."""
