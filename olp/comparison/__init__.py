"""Measured runs beside the nominal path: frames, pairing, figures."""
