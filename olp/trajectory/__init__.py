"""Re-timing: a route of waypoints to a motion in time that keeps every axis within its limits."""
