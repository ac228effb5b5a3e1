"""Calibration files: their tables, grids, covariance and thermal structure, read and written."""
