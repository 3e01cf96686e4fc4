"""Teaching by hand: from a run in which a hand led the tool to a path that is followed."""
