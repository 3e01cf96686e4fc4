"""Robot and controller in two processes: a simulated robot, and control by messages."""
