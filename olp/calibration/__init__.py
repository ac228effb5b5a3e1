"""Measurements to a calibration: instruments, one adjustment, evaluation, diagnosis, design."""
