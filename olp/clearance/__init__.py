"""Distances of a moving tool from triangles: no text, no files, no error model.

`parts` describes tools as stacked cones, `sweep` paths as straight segments, `tree` triangles as a tree of
boxes. `distance` measures one swept part against one triangle, and `search` finds the nearest triangle of
each segment.
"""
