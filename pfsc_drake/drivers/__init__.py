"""What robots and controllers tell each other over LCM, as Drake's own drivers do."""
