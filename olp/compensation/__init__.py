"""Toolpath and error model to commands, and commands to edits of the text."""
