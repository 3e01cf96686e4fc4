"""Tasks of a tool: manifold, projection, motion along the manifold, and start."""
