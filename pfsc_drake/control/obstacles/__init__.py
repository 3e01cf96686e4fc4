"""Moving obstacles: progress along a path waits for them, and the null space avoids them."""
