"""What to measure: where, in which order, and what the readings would determine."""
