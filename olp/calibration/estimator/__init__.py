"""One linear Gaussian adjustment of all readings of a machine, and its results."""
