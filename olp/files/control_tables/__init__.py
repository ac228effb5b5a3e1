"""Compensation tables of controls, read and written, one module per control."""
