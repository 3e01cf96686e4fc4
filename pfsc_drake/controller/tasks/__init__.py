"""Tasks of a tool: a manifold, its projection, the motion along it, and where both begin."""
