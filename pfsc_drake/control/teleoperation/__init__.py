"""Two sides that move each other over a channel: how they are coupled, and never give energy."""
