"""Findings: what a person should know about a run, as data with stable codes, all in one catalogue."""
