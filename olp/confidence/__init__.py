"""How sure a corrected path is: bands, probabilities and advice from the uncertainty of the calibration."""
