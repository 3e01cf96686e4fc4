"""What a scenario file says: its schema, one file per block."""
