"""What a controller meets and does not know: friction, drives, sensors, hands, forces."""
