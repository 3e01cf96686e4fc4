"""Control without Drake: manifolds, laws, compliance, estimation."""
