"""Comparison of measured runs with the nominal path: frames, pairing, figures."""
