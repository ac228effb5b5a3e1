"""Instruments as files: one module each, which reads and writes its tables in a plan and its readings."""
