"""Uncertainty of a corrected path: bands, probabilities and advice from that of the calibration."""
