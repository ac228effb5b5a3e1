"""The calibrated model as C code for controls that correct in real time."""
