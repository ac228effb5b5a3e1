"""Machine and calibration files of machines of any joints, and other descriptions of them."""
