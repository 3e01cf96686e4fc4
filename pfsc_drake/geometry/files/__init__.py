"""Files of numbers, points and triangles."""
