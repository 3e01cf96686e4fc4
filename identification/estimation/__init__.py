"""Parameters and their uncertainty from measurements."""
