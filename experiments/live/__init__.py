"""Live sessions: a person guides the robot in real time, and what was done can be repeated."""
