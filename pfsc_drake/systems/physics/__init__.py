"""Systems of a plant's environment: drives, friction, sensors, operators, forces."""
