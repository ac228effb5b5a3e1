"""Ways to make a calibration from measurements, side by side: the paper's and the adjustment."""
