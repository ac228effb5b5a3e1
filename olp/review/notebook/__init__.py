"""The pictures of a review in a meshcat visualizer, for notebooks and scripts."""
