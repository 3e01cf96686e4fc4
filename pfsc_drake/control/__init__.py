"""What a controller knows: manifolds, laws, compliance, estimation."""
