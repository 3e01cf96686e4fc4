"""Parameters that a body can have: the nearest such set, straight from data, and as a model."""
