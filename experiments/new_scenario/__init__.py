"""``pfsc init``: a first scenario for a robot model and points of the user's own."""
