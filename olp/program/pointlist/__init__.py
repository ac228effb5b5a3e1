"""Lists of positions: tables whose rows are waypoints, in order."""
