"""Calibration of machines of any joints: unknowns, readings, the adjustment and what it determines."""
