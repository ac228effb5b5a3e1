"""Files of measurements of each instrument, one file an instrument, and the list of them."""
