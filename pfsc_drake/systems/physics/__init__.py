"""Systems of the world around a plant: drives, friction, sensors, hands, forces."""
