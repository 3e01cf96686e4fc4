"""What can be chosen of a controller; blocks of a scenario file are these."""
