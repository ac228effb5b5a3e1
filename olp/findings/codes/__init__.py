"""The codes of findings, one table of data per topic."""
