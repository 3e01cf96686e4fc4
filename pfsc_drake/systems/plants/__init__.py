"""Plants beyond Drake's own, and external forces on them."""
