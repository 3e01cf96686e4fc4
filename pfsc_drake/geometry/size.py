"""What lengths paths and surfaces may have."""

# m: shorter ones are no motion of a robot, and coordinates beyond leave no digits for it.
SHORTEST, FARTHEST = 1e-4, 1e4
