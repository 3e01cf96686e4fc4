"""Messages of robot drivers over LCM."""
