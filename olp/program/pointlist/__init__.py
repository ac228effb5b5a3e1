"""Lists of positions: tables whose rows are places, in order."""
