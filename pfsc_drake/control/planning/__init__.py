"""Drive demand of a planned motion, and the speed scaling that keeps it within limits."""
