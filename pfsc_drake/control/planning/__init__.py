"""What a motion will ask of the drives, and how slowly it must go so that they can."""
