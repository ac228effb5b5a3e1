"""Bytes, numbers, statements and edits of a text, whatever its dialect."""
