"""The error sources of a calibration, one file each, and the list of them."""
