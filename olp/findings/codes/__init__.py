"""The codes of findings, one table of data a topic."""
