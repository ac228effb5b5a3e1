"""Readings of instruments as values and as rows of the adjustment, one file per instrument."""
