"""Compensation tables of controls, read and written, one file a control."""
