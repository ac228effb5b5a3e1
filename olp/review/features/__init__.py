"""The part in its own terms: operations, holes, walls, arcs, flat areas and contours of a program."""
