"""Position to error: what the tool really does, relative to the workpiece, for every axis position."""
