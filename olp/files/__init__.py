"""The files that you write and that `olp` writes. Below the command line, no other package opens a file."""
