"""CasADi functions as machine code, bound to their arrays."""
