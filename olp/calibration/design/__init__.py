"""What to measure: where, in which order, and what it would tell."""
