"""Instruments as files: one file each, its tables in a plan, its readings, both ways."""
