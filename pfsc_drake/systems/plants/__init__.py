"""Plants that Drake does not have, and what acts on them."""
