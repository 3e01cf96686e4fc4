"""What surrounds a robot: hands, forces, workpieces."""
