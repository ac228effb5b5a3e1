"""Re-timing: a route of way-points to a motion in time that keeps every axis inside its limits."""
