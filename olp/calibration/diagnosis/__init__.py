"""A calibration judged by independent points, and refined by measured runs."""
