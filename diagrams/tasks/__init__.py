"""Tasks in diagrams: manifold, law, reference, compliance."""
