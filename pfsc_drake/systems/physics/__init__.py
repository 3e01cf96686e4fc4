"""Systems of the world: plants, drives, friction, sensors, hands, forces."""
